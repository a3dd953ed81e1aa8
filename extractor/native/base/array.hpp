// Arrays with named dimensions: views over memory that belongs to somebody else, and arrays that own their
// memory. Records of them cross to Python by the names of their fields.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <memory>
#include <tuple>
#include <type_traits>

// Within a struct: its fields in one list, by whose names Python's objects are read.
#define CMP_FIELDS(...)                                \
  static constexpr const char FIELDS[] = #__VA_ARGS__; \
  auto fields() { return std::tie(__VA_ARGS__); }

// The same for a struct that is returned as an object of a class in Python: its module and name.
#define CMP_RECORD(python_class, ...)                  \
  static constexpr const char PYTHON[] = python_class; \
  CMP_FIELDS(__VA_ARGS__)

namespace cmp {

using Index = std::ptrdiff_t;

#ifdef CMP_CHECKED
inline constexpr bool CHECKED = true;  // every index is compared with its limit
#else
inline constexpr bool CHECKED = false;
#endif

inline void check_index(Index index, Index limit) {
  if (CHECKED && (index < 0 || index >= limit)) std::abort();
}

// N-dimensional view, rows apart by a stride, the last dimension without gaps. Copying a view copies no
// elements.
template <class T, int N>
class View {
 public:
  View() = default;
  View(T* data, std::array<Index, N> shape) : data_(data), shape_(shape) {
    Index step = 1;
    for (int k = N - 1; k >= 0; --k) {
      stride_[k] = step;
      step *= shape[k];
    }
  }
  View(T* data, std::array<Index, N> shape, std::array<Index, N> stride)
      : data_(data), shape_(shape), stride_(stride) {}

  // a view that may be written is a view that may be read
  operator View<const T, N>() const
    requires(!std::is_const_v<T>)
  {
    return {data_, shape_, stride_};
  }

  Index size(int dimension = 0) const { return shape_[dimension]; }
  const std::array<Index, N>& shape() const { return shape_; }
  T* data() const { return data_; }
  bool is_contiguous() const {
    Index step = 1;
    for (int k = N - 1; k >= 0; --k) {
      if (shape_[k] > 1 && stride_[k] != step) return false;
      step *= shape_[k];
    }
    return true;
  }

  template <class... I>
  T& operator()(I... index) const {
    static_assert(sizeof...(I) == N);
    return at(std::array<Index, N>{static_cast<Index>(index)...});
  }
  // element of a one-dimensional view, else the sub-view at the first index
  decltype(auto) operator[](Index index) const {
    check_index(index, shape_[0]);
    if constexpr (N == 1) {
      return (data_[index]);
    } else {
      std::array<Index, N - 1> shape, stride;
      std::copy(shape_.begin() + 1, shape_.end(), shape.begin());
      std::copy(stride_.begin() + 1, stride_.end(), stride.begin());
      return View<T, N - 1>(data_ + index * stride_[0], shape, stride);
    }
  }
  // items from begin, end excluded, of the first dimension
  View slice(Index begin, Index end) const {
    check_index(begin, shape_[0] + 1);
    check_index(end, shape_[0] + 1);
    auto shape = shape_;
    shape[0] = std::max<Index>(end - begin, 0);
    return {data_ + begin * stride_[0], shape, stride_};
  }
  View from(Index begin) const { return slice(begin, shape_[0]); }
  // all elements in one dimension; for views without gaps
  View<T, 1> flat() const {
    if (CHECKED && !is_contiguous()) std::abort();
    Index count = 1;
    for (Index n : shape_) count *= n;
    return {data_, {count}};
  }
  void fill(std::remove_const_t<T> value) const {
    if constexpr (N == 1) {
      std::fill_n(data_, shape_[0], value);
    } else {
      for (Index i = 0; i < shape_[0]; ++i) (*this)[i].fill(value);
    }
  }

  // iteration over a one-dimensional view
  T* begin() const
    requires(N == 1)
  {
    return data_;
  }
  T* end() const
    requires(N == 1)
  {
    return data_ + shape_[0];
  }

 private:
  T& at(const std::array<Index, N>& index) const {
    Index offset = index[N - 1];
    check_index(index[N - 1], shape_[N - 1]);
    for (int k = 0; k < N - 1; ++k) {
      check_index(index[k], shape_[k]);
      offset += index[k] * stride_[k];
    }
    return data_[offset];
  }

  T* data_ = nullptr;
  std::array<Index, N> shape_{};
  std::array<Index, N> stride_{};
};

// Copies the elements of a view into one of the same shape.
template <class T, int N>
void copy(View<const T, N> from, View<T, N> to) {
  if (N == 1 || (from.is_contiguous() && to.is_contiguous())) {
    std::copy_n(from.data(), from.flat().size(), to.data());
  } else if constexpr (N > 1) {
    for (Index i = 0; i < from.size(); ++i) copy<T, N - 1>(from[i], to[i]);
  }
}

// An array that owns its elements. Not initialised unless a value is given.
template <class T, int N>
class Array {
 public:
  Array() = default;
  explicit Array(std::array<Index, N> shape)
      : shape_(shape), data_(new T[static_cast<std::size_t>(count())]) {}
  Array(std::array<Index, N> shape, T value) : Array(shape) { std::fill_n(data_.get(), count(), value); }
  Array(View<const T, N> other) : Array(other.shape()) { copy<T, N>(other, view()); }

  View<T, N> view() { return {data_.get(), shape_}; }
  View<const T, N> view() const { return {data_.get(), shape_}; }
  operator View<T, N>() { return view(); }
  operator View<const T, N>() const { return view(); }

  Index size(int dimension = 0) const { return shape_[dimension]; }
  const std::array<Index, N>& shape() const { return shape_; }
  Index count() const {
    Index count = 1;
    for (Index n : shape_) count *= n;
    return count;
  }
  template <class... I>
  T& operator()(I... index) {
    return view()(index...);
  }
  template <class... I>
  const T& operator()(I... index) const {
    return view()(index...);
  }
  decltype(auto) operator[](Index index) { return view()[index]; }
  decltype(auto) operator[](Index index) const { return view()[index]; }
  View<T, N> slice(Index begin, Index end) { return view().slice(begin, end); }
  View<T, N> from(Index begin) { return view().from(begin); }
  View<T, 1> flat() { return view().flat(); }
  void fill(T value) { view().fill(value); }
  T* begin() { return data_.get(); }
  T* end() { return data_.get() + count(); }
  T* data() { return data_.get(); }
  // the same array with fewer items in its first dimension
  Array first(Index items) const { return Array(view().slice(0, items)); }
  // gives the elements away
  T* release() { return data_.release(); }

 private:
  std::array<Index, N> shape_{};
  std::unique_ptr<T[]> data_;
};

}  // namespace cmp
