// The response of a camera as tables: from values of 8 bits to light, and back.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/array.hpp"

namespace cmp::image {

// The sizes of the tables are twins of those in extractor/image/response.py, which makes the tables.
inline constexpr int ENTRIES = 2048;         // of the table that encodes light
inline constexpr int LIGHT_STEPS = 1 << 14;  // steps of light from 0 to 255
inline constexpr float BRIGHTEST = 255.0F;   // light of the value 255
inline constexpr double ROOT_OF_BRIGHTEST = 15.968719422671311;
inline constexpr auto STEPS_PER_ROOT = static_cast<float>((ENTRIES - 1) / ROOT_OF_BRIGHTEST);

// A response; light is in units of 1/255 of the light of the value 255.
struct ResponseTables {
  static constexpr bool is_lasting = true;  // read once, as base/binding.hpp says
  View<const float, 1> light;               // (256,) the light of each value
  View<const float, 1> encoded;  // (2 * ENTRIES,) value and derivative at equal steps of light's root
  View<const std::uint16_t, 1> light_steps;    // (256,) the light of each value in LIGHT_STEPS steps
  View<const std::uint8_t, 1> value_of_steps;  // (LIGHT_STEPS,) the nearest value of the light of each step

  CMP_RECORD("extractor.image.response.ResponseTables", light, encoded, light_steps, value_of_steps)
};

// The place of light's value in ResponseTables::encoded; the derivative follows there. Light beyond the table
// has the first or the last value, and NaN, as of an ink without cells, the first.
inline std::int32_t table_place(float light) {
  const float root = std::sqrt(std::min(std::max(0.0F, light), BRIGHTEST));
  return 2 * static_cast<std::int32_t>(root * STEPS_PER_ROOT + 0.5F);
}

// The light of the whole value next to a value from 0 to 255; a double stays a double until it is rounded.
template <class T>
float light_at(View<const float, 1> light, T value) {
  return light[static_cast<std::uint8_t>(static_cast<std::int32_t>(value + 0.5F))];
}

}  // namespace cmp::image
