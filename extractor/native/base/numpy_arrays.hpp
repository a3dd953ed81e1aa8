// NumPy's arrays by their memory, without NumPy's headers: to ask Python for an array's buffer takes several
// times as long. NumPy 1.26 to 2 have the same heads of structures and the same places in the table of
// functions; pybind11 relies on them in the same way.
#pragma once

#include <nanobind/nanobind.h>

#include <cstdint>
#include <type_traits>

namespace cmp {

namespace nb = nanobind;

// The head of NumPy's array.
struct NumpyArray {
  PyObject object;
  char* data;
  int dimensions;
  const Py_ssize_t* shape;
  const Py_ssize_t* strides;  // bytes
  PyObject* base;
  struct Descriptor {
    PyObject object;
    PyTypeObject* scalar;
    char kind, type, byte_order, flags;
    int type_number;
  }* descriptor;
  int flags;
};

// A type of elements: NumPy's name and number of the type.
struct Dtype {
  const char* name;
  int number;
};

constexpr int LONG = 7, LONGLONG = 9;

template <class T>
constexpr Dtype dtype() {
  constexpr int int64 = std::is_same_v<long, std::int64_t> ? LONG : LONGLONG;
  if constexpr (std::is_same_v<T, bool>) return {"bool", 0};
  if constexpr (std::is_same_v<T, double>) return {"float64", 12};
  if constexpr (std::is_same_v<T, float>) return {"float32", 11};
  if constexpr (std::is_same_v<T, std::int8_t>) return {"int8", 1};
  if constexpr (std::is_same_v<T, std::uint8_t>) return {"uint8", 2};
  if constexpr (std::is_same_v<T, std::int16_t>) return {"int16", 3};
  if constexpr (std::is_same_v<T, std::uint16_t>) return {"uint16", 4};
  if constexpr (std::is_same_v<T, std::int32_t>) return {"int32", 5};
  if constexpr (std::is_same_v<T, std::uint32_t>) return {"uint32", 6};
  if constexpr (std::is_same_v<T, std::int64_t>) return {"int64", int64};
  if constexpr (std::is_same_v<T, std::uint64_t>) return {"uint64", int64 + 1};
}

template <class T>
constexpr Dtype DTYPE = dtype<T>();

// What NumPy is asked for.
class Numpy {
 public:
  static const Numpy& get() {
    static const Numpy numpy;
    return numpy;
  }

  // The array that an object is; null for other objects.
  const NumpyArray* array(PyObject* object) const {
    return PyObject_TypeCheck(object, type_) ? reinterpret_cast<NumpyArray*>(object) : nullptr;
  }

  // A new array of memory without gaps, which `owner` keeps.
  template <class T>
  nb::object create(T* data, int dimensions, const Py_ssize_t* shape, nb::object owner) const {
    constexpr int WITHOUT_GAPS = 0x1, ALIGNED = 0x100, WRITABLE = 0x400;
    PyObject* array = create_(type_, dimensions, shape, DTYPE<T>.number, nullptr, data, sizeof(T),
                              WITHOUT_GAPS | ALIGNED | WRITABLE, nullptr);
    if (array == nullptr || set_base_(array, owner.release().ptr()) != 0) throw nb::python_error();
    return nb::steal(array);
  }

  // Whether an array has elements of a type, in this machine's order of bytes.
  template <class T>
  static bool has_type(const NumpyArray& array) {
    const NumpyArray::Descriptor& descriptor = *array.descriptor;
    const int found = descriptor.type_number;
    const bool is_twin = (found == LONG || found == LONGLONG) && sizeof(T) == sizeof(long long) &&
                         sizeof(long) == sizeof(long long) && std::is_signed_v<T> && std::is_integral_v<T>;
    return (found == DTYPE<T>.number || is_twin) && descriptor.byte_order != '>';
  }
  static bool is_writable(const NumpyArray& array) { return (array.flags & 0x400) != 0; }

 private:
  using Create = PyObject* (*)(PyTypeObject*, int, const Py_ssize_t*, int, const Py_ssize_t*, void*, int, int,
                               PyObject*);
  using SetBase = int (*)(PyObject*, PyObject*);

  // places in NumPy's table of functions
  static constexpr int ARRAY_TYPE = 2, ARRAY_NEW = 93, SET_BASE = 282;

  Numpy() {
    PyObject* module = PyImport_ImportModule("numpy._core._multiarray_umath");
    if (module == nullptr) {  // NumPy 1
      PyErr_Clear();
      module = PyImport_ImportModule("numpy.core._multiarray_umath");
    }
    if (module == nullptr) throw nb::python_error();
    const nb::object table = nb::steal(module).attr("_ARRAY_API");
    void** const entries = static_cast<void**>(PyCapsule_GetPointer(table.ptr(), nullptr));
    if (entries == nullptr) throw nb::python_error();
    type_ = static_cast<PyTypeObject*>(entries[ARRAY_TYPE]);
    create_ = reinterpret_cast<Create>(entries[ARRAY_NEW]);
    set_base_ = reinterpret_cast<SetBase>(entries[SET_BASE]);
  }

  PyTypeObject* type_;
  Create create_;
  SetBase set_base_;
};

}  // namespace cmp
