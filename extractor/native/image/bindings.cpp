// Room "image" for Python.
#include "base/binding.hpp"

#include "image/contrast_maps.hpp"
#include "image/input.hpp"
#include "image/pyramid.hpp"

namespace cmp::image {

void add_image(nb::module_ module) {
  bind<&estimate_noise>(module, "estimate_noise", {"image", "xy", "cells"});
  bind<&channel_noise>(module, "channel_noise", {"channels"});
  bind<&block_means>(module, "block_means", {"image", "scale", "light_steps", "value_of_steps"});
}

}  // namespace cmp::image
