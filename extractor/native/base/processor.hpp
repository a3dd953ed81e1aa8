// What the processor can do, and loops that are compiled for it besides the least processor of the build.
#pragma once

#ifdef CMP_NEEDS_V3
#include <cpuid.h>
#endif

// Of a function that a loop calls within a function of its own: clang makes no part of the loop of it by
// itself.
#define CMP_PART_OF_LOOP [[gnu::always_inline]] inline

namespace cmp {

#ifdef CMP_NEEDS_V3
// Registers of the instruction "cpuid". Asked of the processor itself: __builtin_cpu_supports of zig's
// library answers no on every processor.
struct ProcessorFlags {
  unsigned c_of_1 = 0, b_of_7 = 0;
  unsigned saved_by_system = 0;  // registers that a change of the task keeps

  ProcessorFlags() {
    constexpr unsigned HAS_XGETBV = 1U << 27;
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & HAS_XGETBV)) return;
    c_of_1 = c;
    asm("xgetbv" : "=a"(saved_by_system), "=d"(d) : "c"(0));
    if (__get_cpuid_count(7, 0, &a, &b, &c, &d)) b_of_7 = b;
  }

  // Whether processor and system have AVX2, FMA and BMI2.
  bool has_v3() const {
    constexpr unsigned FMA = 1U << 12, AVX2 = 1U << 5, BMI2 = 1U << 8, YMM = 6;
    return (c_of_1 & FMA) && (b_of_7 & AVX2) && (b_of_7 & BMI2) && (saved_by_system & YMM) == YMM;
  }

  // Whether they have AVX-512 with the extensions F, DQ, CD, BW and VL, too.
  bool has_v4() const {
    constexpr unsigned EXTENSIONS = 1U << 16 | 1U << 17 | 1U << 28 | 1U << 30 | 1U << 31, ZMM = 0xE6;
    return has_v3() && (b_of_7 & EXTENSIONS) == EXTENSIONS && (saved_by_system & ZMM) == ZMM;
  }
};

#ifdef __clang__
#define CMP_WIDE gnu::flatten, gnu::target("avx512f,avx512dq,avx512cd,avx512bw,avx512vl")
#else
#define CMP_WIDE \
  gnu::flatten, gnu::target("avx512f,avx512dq,avx512cd,avx512bw,avx512vl,prefer-vector-width=512")
#endif

// Whether loops run with the vectors of AVX-512; true at first where the processor has them.
inline bool& wide_loops() {
  static bool is_wide = ProcessorFlags().has_v4();
  return is_wide;
}

template <auto LOOP>
struct WideLoop;

// A loop compiled for the vectors of AVX-512. The functions that the loop calls become part of it.
template <class... Arguments, void (*LOOP)(Arguments...)>
struct WideLoop<LOOP> {
  [[CMP_WIDE]] static void run(Arguments... arguments) { LOOP(arguments...); }
};
#endif

// Runs a loop with the widest vectors that the processor has.
//
// A loop whose pixels do not depend on each other gives the same bits on every processor, as contraction to
// fused operations is off or the same for all vectors.
template <auto LOOP, class... Arguments>
inline void run_loop(Arguments&&... arguments) {
#ifdef CMP_NEEDS_V3
  if (wide_loops()) {
    WideLoop<LOOP>::run(arguments...);
    return;
  }
#endif
  LOOP(arguments...);
}

// Runs loops with the widest vectors that the processor has, or with those of the least processor, for tests.
//
// Whether the two differ here.
inline bool use_widest_vectors(bool is_widest) {
#ifdef CMP_NEEDS_V3
  const bool has_wide = ProcessorFlags().has_v4();
  wide_loops() = is_widest && has_wide;
  return has_wide;
#else
  static_cast<void>(is_widest);
  return false;
#endif
}

}  // namespace cmp
