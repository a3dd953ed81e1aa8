// The values of a sensor for light.
#include "base/binding.hpp"

#include <cmath>

namespace cmp {

namespace {

// Fills `values` (N,) with the values of `light` (N,), 0 to 255 and more.
//
// light_of_value (256,): the response. first (S,): the last value with no more light than each of S equal
// steps of the square root of light has.
void fill_values(View<const float, 1> light, View<const double, 1> light_of_value,
                 View<const std::int64_t, 1> first, View<float, 1> values) {
  const Index last = light_of_value.size() - 2, steps = first.size() - 1;
  const double scale = static_cast<double>(steps) / std::sqrt(255.0);
  for (Index i = 0; i < light.size(); ++i) {
    const double here = light[i];
    if (!(here > light_of_value[0])) {
      values[i] = 0.0F;
      continue;
    }
    Index value = first[static_cast<Index>(std::min(std::sqrt(here) * scale, static_cast<double>(steps)))];
    // most often none or one is missing: the first one without a branch, which the processor could not guess
    value += static_cast<Index>(value < last) & static_cast<Index>(light_of_value[value + 1] <= here);
    while (value < last && light_of_value[value + 1] <= here) ++value;
    // above the last value the last step continues: the sensor clips after the noise
    const double low = light_of_value[value], high = light_of_value[value + 1];
    values[i] = static_cast<float>(static_cast<double>(value) + (here - low) / (high - low));
  }
}

}  // namespace

void add_encoding(nb::module_ module) {
  bind<&fill_values>(module, "fill_values", {"light", "light_of_value", "first", "values"});
}

}  // namespace cmp
