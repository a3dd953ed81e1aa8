// Loops over many items in two threads.
#pragma once

#include <future>
#include <utility>

#include "base/array.hpp"

namespace cmp {

// Items from which on a loop runs in two threads: patterns of 75 and more layers have that many gridlines.
// Chosen: frames of a sensor stay in their own thread.
inline Index& min_items_in_parts() {
  static Index least = 50'000;
  return least;
}

// Runs loops of so many items in two threads, for tests; the number before.
inline Index use_parts_from(Index items) { return std::exchange(min_items_in_parts(), items); }

// Calls body(begin, end) for all of `count` numbers; with many items, for both halves at once.
//
// The numbers do not depend on each other, so that the results are the same.
template <class Body>
void in_parts(Index count, Index items, const Body& body) {
  if (items < min_items_in_parts()) {
    body(0, count);
    return;
  }
  auto second = std::async(std::launch::async, [&] { body(count / 2, count); });
  body(0, count / 2);
  second.get();
}

}  // namespace cmp
