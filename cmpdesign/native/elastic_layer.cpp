// The elastic layer's response wave by wave, as one pass over memory.
#include "base/binding.hpp"

namespace cmp {

namespace {

// Replaces the spectra (3, rows, columns, 2) of tractions, real and imaginary parts, by those of
// displacements. xx to yz: (rows, columns) spectra of the kernels, see `operator.KernelSpectra`.
template <class T>
void update_load_spectra(View<T, 4> loads, View<const T, 2> xx, View<const T, 2> yy, View<const T, 2> zz,
                         View<const T, 2> xy, View<const T, 2> xz, View<const T, 2> yz) {
  for (Index row = 0; row < loads.size(1); ++row) {
    const auto of_x = loads[0][row], of_y = loads[1][row], of_z = loads[2][row];
    for (Index at = 0; at < loads.size(2); ++at) {
      const T x = of_x(at, 0), y = of_y(at, 0), z = of_z(at, 0);
      const T ix = of_x(at, 1), iy = of_y(at, 1), iz = of_z(at, 1);
      const T plane = xy(row, at), a = xz(row, at), b = yz(row, at);
      of_x(at, 0) = xx(row, at) * x + plane * y - a * iz;
      of_x(at, 1) = xx(row, at) * ix + plane * iy + a * z;
      of_y(at, 0) = plane * x + yy(row, at) * y - b * iz;
      of_y(at, 1) = plane * ix + yy(row, at) * iy + b * z;
      of_z(at, 0) = a * ix + b * iy + zz(row, at) * z;
      of_z(at, 1) = zz(row, at) * iz - a * x - b * y;
    }
  }
}

}  // namespace

void add_elastic_layer(nb::module_ module) {
  bind<&update_load_spectra<double>>(module, "update_load_spectra_float64",
                                     {"loads", "xx", "yy", "zz", "xy", "xz", "yz"});
  bind<&update_load_spectra<float>>(module, "update_load_spectra_float32",
                                    {"loads", "xx", "yy", "zz", "xy", "xz", "yz"});
}

}  // namespace cmp
