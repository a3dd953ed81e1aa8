// The border to Python: arrays are checked, not converted; results own their memory; loops run without the
// GIL.
//
// A function takes views, records, numbers and booleans, and returns an array, a number, a record or a tuple
// of these. A record crosses by the names of its fields (CMP_FIELDS or CMP_RECORD of base/array.hpp). Other
// structs are thresholds: they stay here, and a function takes their defaults.
#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "array.hpp"
#include "numpy_arrays.hpp"
#include "processor.hpp"

namespace cmp {

namespace nb = nanobind;

// The name of an argument or of a field of one, for messages.
struct Name {
  const Name* owner;
  const char* own;

  std::string text() const { return owner == nullptr ? own : owner->text() + "." + own; }
};

// What a call has read from records, kept until it ends: a property may have made its array for this call.
using Borrowed = std::vector<nb::object>;

template <class T>
struct FromPython;

template <class T, int N>
struct FromPython<View<T, N>> {
  using Value = std::remove_const_t<T>;

  static View<T, N> get(nb::handle object, const Name& name, Borrowed&) {
    const NumpyArray* array = Numpy::get().array(object.ptr());
    if (array == nullptr) throw nb::type_error((name.text() + " is no array").c_str());
    if (array->dimensions != N || !Numpy::has_type<Value>(*array)) refuse(*array, name);
    if (!std::is_const_v<T> && !Numpy::is_writable(*array))
      throw nb::type_error((name.text() + " cannot be written").c_str());
    T* const data = reinterpret_cast<T*>(array->data);
    std::array<Index, N> shape, stride;
    std::copy_n(array->shape, N, shape.begin());
    if (std::find(shape.begin(), shape.end(), 0) != shape.end()) return {data, shape};
    for (int k = 0; k < N; ++k) {
      stride[k] = array->strides[k] / static_cast<Index>(sizeof(T));
      bool is_whole = array->strides[k] % static_cast<Py_ssize_t>(sizeof(T)) == 0;
      bool has_gap = k == N - 1 && shape[k] > 1 && stride[k] != 1;
      if (!is_whole || has_gap)
        throw nb::type_error((name.text() + " has gaps within its rows; give a contiguous array").c_str());
    }
    return {data, shape, stride};
  }

 private:
  [[noreturn]] static void refuse(const NumpyArray& array, const Name& name) {
    std::string text = name.text() + " must be " + DTYPE<Value>.name + " of " + std::to_string(N) +
                       " dimensions, and is '" + array.descriptor->type + "' of " +
                       std::to_string(array.dimensions);
    throw nb::type_error(text.c_str());
  }
};

template <class T>
  requires std::is_arithmetic_v<T>
struct FromPython<T> {
  static T get(nb::handle object, const Name& name, Borrowed&) {
    if constexpr (std::is_same_v<T, bool>) return PyObject_IsTrue(object.ptr()) == 1;
    T value{};
    if (!nb::try_cast(object, value))
      throw nb::type_error((name.text() + " is no number of the type that is needed").c_str());
    return value;
  }
};

template <class T>
concept Record = requires { T::FIELDS; };

// A record that Python has a class of.
template <class T>
concept NamedRecord = Record<T> && requires { T::PYTHON; };

// A record of tables that are made once, as those of a layout; their arrays keep their shape.
template <class T>
concept Lasting = Record<T> && T::is_lasting;

template <Record T>
constexpr std::size_t FIELD_COUNT = std::tuple_size_v<decltype(std::declval<T&>().fields())>;

// The names of a record's fields as a tuple of Python's texts, made once.
template <Record T>
PyObject* field_names() {
  static PyObject* const names = [] {
    PyObject* made = PyTuple_New(FIELD_COUNT<T>);
    std::string_view left = T::FIELDS;
    for (std::size_t k = 0; k < FIELD_COUNT<T>; ++k) {
      const std::string_view name = left.substr(0, left.find(','));
      PyTuple_SET_ITEM(made, k, PyUnicode_InternFromString(std::string(name).c_str()));
      left.remove_prefix(std::min(name.size() + 2, left.size()));
    }
    return made;
  }();
  return names;
}

template <Record T>
struct FromPython<T> {
  static T get(nb::handle object, const Name& name, Borrowed& borrowed) {
    if constexpr (!Lasting<T>) {
      return read(object, name, borrowed);
    } else {
      static PyObject* last = nullptr;  // is kept, so that no other object gets its address
      static T record;
      if (object.ptr() == last) return record;
      const T found = read(object, name, borrowed);
      if (PyTuple_Check(object.ptr()) != 0) {  // whose fields do not change
        record = found;
        // given back last, as that may run code that reads a record
        const nb::object former = nb::steal(std::exchange(last, object.inc_ref().ptr()));
      }
      return found;
    }
  }

 private:
  static T read(nb::handle object, const Name& name, Borrowed& borrowed) {
    T record{};
    int k = 0;
    std::apply([&](auto&... field) { (update(field, object, k++, name, borrowed), ...); }, record.fields());
    return record;
  }

  template <class Field>
  static void update(Field& field, nb::handle object, int k, const Name& name, Borrowed& borrowed) {
    PyObject* const text = PyTuple_GET_ITEM(field_names<T>(), k);
    const char* own = PyUnicode_AsUTF8(text);
    nb::object value = nb::steal(PyObject_GetAttr(object.ptr(), text));
    if (!value.is_valid()) {
      PyErr_Clear();
      throw nb::type_error((name.text() + " has no field " + own).c_str());
    }
    field = FromPython<Field>::get(value, Name{&name, own}, borrowed);
    borrowed.push_back(std::move(value));
  }
};

// A value that may be None.
template <class T>
struct FromPython<std::optional<T>> {
  static std::optional<T> get(nb::handle object, const Name& name, Borrowed& borrowed) {
    if (object.is_none()) return std::nullopt;
    return FromPython<T>::get(object, name, borrowed);
  }
};

// A record of numbers from a tuple or list of that length.
template <class T, std::size_t N>
struct FromPython<std::array<T, N>> {
  static std::array<T, N> get(nb::handle object, const Name& name, Borrowed& borrowed) {
    std::array<T, N> values;
    if (PySequence_Check(object.ptr()) == 0 || nb::len(object) != N)
      throw nb::type_error((name.text() + " must have " + std::to_string(N) + " items").c_str());
    for (std::size_t k = 0; k < N; ++k) {
      nb::object item = object[k];
      values[k] = FromPython<T>::get(item, name, borrowed);
      borrowed.push_back(std::move(item));
    }
    return values;
  }
};

template <class T, int N>
nb::object to_python(Array<T, N>&& array) {
  std::array<Py_ssize_t, N> shape;
  std::copy(array.shape().begin(), array.shape().end(), shape.begin());
  T* data = array.release();
  if (data == nullptr) data = new T[1];
  PyObject* const owner = PyCapsule_New(data, nullptr, [](PyObject* capsule) {
    delete[] static_cast<T*>(PyCapsule_GetPointer(capsule, nullptr));
  });
  return Numpy::get().create(data, N, shape.data(), nb::steal(owner));
}

template <class T>
  requires std::is_arithmetic_v<T>
nb::object to_python(T value) {
  return nb::cast(value);
}

template <NamedRecord T>
nb::object to_python(T&& record);

template <class T>
nb::object to_python(std::optional<T>&& value) {
  return value ? to_python(std::move(*value)) : nb::none();
}

// A record as an object of its class in Python, made with the names of the fields.
template <NamedRecord T>
nb::object to_python(T&& record) {
  static PyObject* made_class = nullptr;  // found at first use: its module imports this one
  if (made_class == nullptr) {
    const std::string_view path = T::PYTHON;
    const std::size_t dot = path.rfind('.');
    nb::object module = nb::module_::import_(std::string(path.substr(0, dot)).c_str());
    made_class = PyObject_GetAttrString(module.ptr(), path.data() + dot + 1);
    if (made_class == nullptr) throw nb::python_error();
  }
  auto values = std::apply(
      [](auto&... field) { return std::array<nb::object, FIELD_COUNT<T>>{to_python(std::move(field))...}; },
      record.fields());
  std::array<PyObject*, FIELD_COUNT<T>> items;
  for (std::size_t k = 0; k < items.size(); ++k) items[k] = values[k].ptr();
  PyObject* object = PyObject_Vectorcall(made_class, items.data(), 0, field_names<T>());
  if (object == nullptr) throw nb::python_error();
  return nb::steal(object);
}

template <class... T>
nb::object to_python(std::tuple<T...>&& values) {
  return std::apply([](auto&&... value) { return nb::make_tuple(to_python(std::move(value))...); },
                    std::move(values));
}

// The name of a type in signatures.
template <class T>
struct TypeName {
  static std::string get() {
    if constexpr (NamedRecord<T>)
      return T::PYTHON;
    else if constexpr (std::is_same_v<T, bool>)
      return "bool";
    else if constexpr (std::is_floating_point_v<T>)
      return "float";
    else if constexpr (std::is_integral_v<T>)
      return "int";
    else
      return std::is_void_v<T> ? "None" : "typing.Any";
  }
};

template <class T, int N>
struct TypeName<View<T, N>> {
  static std::string get() {
    const std::string name = DTYPE<std::remove_const_t<T>>.name;
    return "numpy.typing.NDArray[numpy." + name + (name == "bool" ? "_]" : "]");
  }
};

template <class T, int N>
struct TypeName<Array<T, N>> : TypeName<View<T, N>> {};

template <class T>
struct TypeName<std::optional<T>> {
  static std::string get() { return TypeName<T>::get() + " | None"; }
};

template <class T, std::size_t N>
struct TypeName<std::array<T, N>> {
  static std::string get() { return "collections.abc.Sequence[" + TypeName<T>::get() + "]"; }
};

template <class... T>
struct TypeName<std::tuple<T...>> {
  static std::string get() {
    std::string names;
    ((names += (names.empty() ? "" : ", ") + TypeName<T>::get()), ...);
    return "tuple[" + names + "]";
  }
};

// Refuses to go on where the processor lacks the instructions that the loops were compiled for.
inline void require_processor() {
#ifdef CMP_NEEDS_V3
  if (!ProcessorFlags().has_v3())
    throw nb::import_error(
        "this build needs a processor with AVX2, FMA and BMI2 (x86-64-v3); for older ones build with "
        "pip install . -C cmake.define.CMP_CPU=x86-64");
#endif
}

template <class T>
concept Thresholds = std::is_class_v<T> && !requires { &FromPython<T>::get; };

template <auto F, class Signature>
struct Bound;

template <auto F, class Result, class... Arguments>
struct Bound<F, Result (*)(Arguments...)> {
  static constexpr std::size_t COUNT = (std::size_t{!Thresholds<std::remove_cvref_t<Arguments>>} + ... + 0);
  using Names = std::array<const char*, COUNT>;

  static void add(nb::module_& module, const char* name, const Names& names) {
    add(module, name, names, std::make_index_sequence<COUNT>(), std::index_sequence_for<Arguments...>());
  }

 private:
  using Given = std::array<nb::handle, COUNT>;
  template <std::size_t>
  using Handle = nb::handle;

  // The place of each argument among those that Python gives.
  static constexpr auto PLACES = [] {
    std::array<std::size_t, sizeof...(Arguments)> places{};
    std::size_t k = 0, given = 0;
    ((places[k++] = given, given += !Thresholds<std::remove_cvref_t<Arguments>>), ...);
    return places;
  }();

  template <std::size_t... G, std::size_t... K>
  static void add(nb::module_& module, const char* name, const Names& names, std::index_sequence<G...>,
                  std::index_sequence<K...> all) {
    const std::string parameters =
        (std::string() + ... + parameter<std::remove_cvref_t<Arguments>>(names, K));
    const std::string signature =
        "def " + std::string(name) + "(" + parameters + ") -> " + TypeName<Result>::get();
    module.def(
        name, [names, all](Handle<G>... given) { return call(names, Given{given...}, all); },
        nb::arg(names[G]).none()..., nb::sig(signature.c_str()));
  }

  template <class T>
  static std::string parameter(const Names& names, std::size_t k) {
    if constexpr (Thresholds<T>)
      return "";
    else
      return (PLACES[k] == 0 ? "" : ", ") + (names[PLACES[k]] + (": " + TypeName<T>::get()));
  }

  template <std::size_t... K>
  static nb::object call(const Names& names, const Given& given, std::index_sequence<K...>) {
    Borrowed borrowed;
    std::tuple<std::remove_cvref_t<Arguments>...> values{
        value<std::remove_cvref_t<Arguments>>(names, given, K, borrowed)...};
    if constexpr (std::is_void_v<Result>) {
      nb::gil_scoped_release released;
      F(std::get<K>(values)...);
    } else {
      Result result = [&] {
        nb::gil_scoped_release released;
        return F(std::get<K>(values)...);
      }();
      return to_python(std::move(result));
    }
    return nb::none();
  }

  template <class T>
  static T value(const Names& names, const Given& given, std::size_t k, Borrowed& borrowed) {
    if constexpr (Thresholds<T>)
      return T{};
    else
      return FromPython<T>::get(given[PLACES[k]], Name{nullptr, names[PLACES[k]]}, borrowed);
  }
};

// Makes a function known to Python under a name, with the names of its arguments but for thresholds.
template <auto F>
void bind(nb::module_& module, const char* name, typename Bound<F, decltype(F)>::Names names) {
  Numpy::get();  // imported here, as an import within a call could wait for another thread
  Bound<F, decltype(F)>::add(module, name, names);
}

}  // namespace cmp
