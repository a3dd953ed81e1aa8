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
  bind<&hue_shifts>(module, "hue_shifts", {"weight", "nominal_deg", "limits"});
  bind<&ink_of_hue>(module, "ink_of_hue", {"hues_deg", "limits"});
  bind<&tile_statistics>(module, "tile_statistics", {"image", "tile_px", "step"});
  bind<&grey_card_fields>(module, "grey_card_fields", {"statistics", "limits"});
  bind<&with_fields>(module, "with_fields", {"image", "gain", "offset", "tile_px"});
  bind<&subsampled>(module, "subsampled", {"plane"});
  bind<&hue_ranges>(module, "hue_ranges", {"inks"});
  bind<&tile_max_chroma>(module, "tile_max_chroma", {"hue", "chroma", "ranges", "tile", "limits"});
  bind<&tile_thresholds>(module, "tile_thresholds", {"level", "limits"});
  bind<&label_pixels>(module, "label_pixels", {"hue", "chroma", "ranges", "tiles"});
  bind<&estimate_noise>(module, "estimate_noise", {"image", "xy", "cells", "limits"});
  bind<&block_means>(module, "block_means", {"image", "scale", "light_steps", "value_of_steps"});
  bind<&tile_chroma>(module, "tile_chroma", {"chroma", "tile_px"});
  bind<&target_mask>(module, "target_mask", {"chroma", "limits"});
}

}  // namespace cmp::image
