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
#include <stdexcept>
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

// What a call has borrowed from Python beside its arguments; given back when the call ends.
class Borrowed {
 public:
  Borrowed() = default;
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  ~Borrowed() {
    for (Py_buffer& buffer : buffers_) PyBuffer_Release(&buffer);
  }
  const Py_buffer& add(PyObject* object, bool is_written, const Name& name) {
    Py_buffer& buffer = buffers_.emplace_back();
    int flags = PyBUF_STRIDES | PyBUF_FORMAT | (is_written ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(object, &buffer, flags) != 0) {
      buffers_.pop_back();
      PyErr_Clear();
      throw nb::type_error(
          (name.text() + " is no array" + (is_written ? " that can be written" : "")).c_str());
    }
    return buffer;
  }
  void keep(nb::object object) { objects_.push_back(std::move(object)); }

 private:
  std::vector<Py_buffer> buffers_;
  std::vector<nb::object> objects_;
};

template <class T>
constexpr const char* dtype_name() {
  if constexpr (std::is_same_v<T, bool>) return "bool";
  if constexpr (std::is_same_v<T, double>) return "float64";
  if constexpr (std::is_same_v<T, float>) return "float32";
  if constexpr (std::is_same_v<T, std::int64_t>) return "int64";
  if constexpr (std::is_same_v<T, std::int32_t>) return "int32";
  if constexpr (std::is_same_v<T, std::int16_t>) return "int16";
  if constexpr (std::is_same_v<T, std::int8_t>) return "int8";
  if constexpr (std::is_same_v<T, std::uint64_t>) return "uint64";
  if constexpr (std::is_same_v<T, std::uint32_t>) return "uint32";
  if constexpr (std::is_same_v<T, std::uint16_t>) return "uint16";
  if constexpr (std::is_same_v<T, std::uint8_t>) return "uint8";
}

template <class T>
bool has_dtype(const Py_buffer& buffer) {
  const char* format = buffer.format == nullptr ? "B" : buffer.format;
  if (*format == '@' || *format == '=' || *format == '<') ++format;
  if (format[0] == '\0' || format[1] != '\0' || buffer.itemsize != static_cast<Py_ssize_t>(sizeof(T)))
    return false;
  if constexpr (std::is_same_v<T, bool>) return *format == '?';
  const std::string kinds = std::is_floating_point_v<T> ? "fd" : std::is_signed_v<T> ? "bhilq" : "BHILQ";
  return kinds.find(*format) != std::string::npos;
}

template <class T>
struct FromPython;

template <class T, int N>
struct FromPython<View<T, N>> {
  using Value = std::remove_const_t<T>;

  static View<T, N> get(nb::handle object, const Name& name, Borrowed& borrowed) {
    if (const NumpyArray* array = fitting_array(object.ptr()))
      return strided({reinterpret_cast<T*>(array->data), array->shape, array->strides}, name);
    const Py_buffer& buffer = borrowed.add(object.ptr(), !std::is_const_v<T>, name);
    if (buffer.ndim != N || !has_dtype<Value>(buffer)) refuse(buffer, name);
    return strided({static_cast<T*>(buffer.buf), buffer.shape, buffer.strides}, name);
  }

 private:
  // The memory of an array.
  struct Memory {
    T* data;
    const Py_ssize_t *shape, *strides;  // strides in bytes
  };

  // The array of NumPy that an object is, of the right type and dimensions; null for others.
  static const NumpyArray* fitting_array(PyObject* object) {
    const NumpyArray* array = Numpy::get().array(object);
    const bool is_fitting = array != nullptr && array->dimensions == N && Numpy::has_type<Value>(*array) &&
                            (std::is_const_v<T> || Numpy::is_writable(*array));
    return is_fitting ? array : nullptr;
  }

  static View<T, N> strided(const Memory& memory, const Name& name) {
    std::array<Index, N> shape, stride;
    std::copy_n(memory.shape, N, shape.begin());
    if (std::find(shape.begin(), shape.end(), 0) != shape.end()) return {memory.data, shape};
    for (int k = 0; k < N; ++k) {
      stride[k] = memory.strides[k] / static_cast<Index>(sizeof(T));
      bool is_whole = memory.strides[k] % static_cast<Py_ssize_t>(sizeof(T)) == 0;
      bool has_gap = k == N - 1 && shape[k] > 1 && stride[k] != 1;
      if (!is_whole || has_gap)
        throw nb::type_error((name.text() + " has gaps within its rows; give a contiguous array").c_str());
    }
    return {memory.data, shape, stride};
  }

  [[noreturn]] static void refuse(const Py_buffer& buffer, const Name& name) {
    std::string text = name.text() + " must be " + dtype_name<Value>() + " of " + std::to_string(N) +
                       " dimensions, and is '" + (buffer.format == nullptr ? "B" : buffer.format) + "' of " +
                       std::to_string(buffer.ndim);
    throw nb::type_error(text.c_str());
  }
};

template <class T>
  requires std::is_arithmetic_v<T>
struct FromPython<T> {
  static T get(nb::handle object, const Name& name, Borrowed&) {
    PyObject* source = object.ptr();
    bool is_failed = false;
    T value{};
    if constexpr (std::is_same_v<T, bool>) {
      int truth = PyObject_IsTrue(source);
      is_failed = truth < 0;
      value = truth > 0;
    } else if constexpr (std::is_floating_point_v<T>) {
      double number = PyFloat_AsDouble(source);
      is_failed = number == -1.0 && PyErr_Occurred() != nullptr;
      value = static_cast<T>(number);
    } else {
      long long number =
          PyIndex_Check(source) != 0 ? PyLong_AsLongLong(nb::steal(PyNumber_Index(source)).ptr()) : -1;
      is_failed = PyIndex_Check(source) == 0 || (number == -1 && PyErr_Occurred() != nullptr);
      value = static_cast<T>(number);
      is_failed = is_failed || static_cast<long long>(value) != number;
    }
    if (is_failed) {
      PyErr_Clear();
      throw nb::type_error((name.text() + " is no number of the type that is needed").c_str());
    }
    return value;
  }
};

// -- to be removed with the last record of this kind
class Field {
 public:
  Field(nb::object value, Name name, Borrowed& borrowed)
      : value_(std::move(value)), name_(name), borrowed_(borrowed) {}
  template <class T>
  operator T() const {
    return FromPython<T>::get(value_, name_, borrowed_);
  }

 private:
  nb::object value_;
  Name name_;
  Borrowed& borrowed_;
};

class Fields {
 public:
  Fields(nb::handle object, const Name& name, Borrowed& borrowed)
      : object_(object), name_(name), borrowed_(borrowed) {}
  Field operator[](const char* field) const {
    return {nb::object(object_.attr(field)), Name{&name_, field}, borrowed_};
  }

 private:
  nb::handle object_;
  const Name& name_;
  Borrowed& borrowed_;
};

template <class T>
concept OldRecord = requires(const Fields& fields) {
  { T::read(fields) } -> std::same_as<T>;
};

template <OldRecord T>
struct FromPython<T> {
  static T get(nb::handle object, const Name& name, Borrowed& borrowed) {
    return T::read(Fields(object, name, borrowed));
  }
};
// --

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
    borrowed.keep(std::move(value));  // a property may have made its array for this call
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
      borrowed.keep(std::move(item));
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

template <class T>
nb::object to_python(std::optional<T>&& value) {
  return value ? to_python(std::move(*value)) : nb::none();
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
    const std::string name = dtype_name<std::remove_const_t<T>>();
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
