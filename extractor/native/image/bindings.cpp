// Room "image" for Python.
#include "base/binding.hpp"

#include "image/color.hpp"
#include "image/grey_card.hpp"
#include "image/ink_segmentation.hpp"
#include "image/input.hpp"
#include "image/pyramid.hpp"
#include "image/target_area.hpp"

namespace cmp::image {

void add_image(nb::module_ module) {
  bind<&hsv_and_chroma>(module, "hsv_and_chroma", {"image"});
  bind<&hue_weights>(module, "hue_weights", {"hue", "chroma", "limits"});
  bind<&find_hues>(module, "find_hues", {"weight", "nominal_deg", "limits"});
  bind<&tile_statistics>(module, "tile_statistics", {"image", "tile_px", "step"});
  bind<&grey_card_fields>(module, "grey_card_fields", {"statistics", "limits"});
  bind<&with_fields>(module, "with_fields", {"image", "gain", "offset", "tile_px"});
  bind<&segment>(module, "segment", {"hue", "chroma", "target", "nominal_deg", "limits"});
  bind<&estimate_noise>(module, "estimate_noise", {"image", "xy", "cells", "limits"});
  bind<&block_means>(module, "block_means", {"image", "scale", "light_steps", "value_of_steps"});
  bind<&tile_chroma>(module, "tile_chroma", {"chroma", "tile_px"});
  bind<&target_mask>(module, "target_mask", {"chroma", "limits"});
}

}  // namespace cmp::image
