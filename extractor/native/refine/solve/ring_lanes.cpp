#include "refine/solve/ring_lanes.hpp"

namespace cmp::refine {

namespace {

// Eliminates neighbour I from the one after it, from the last one and from the middle.
//
// A direction without positive information is left out. All rows lie at constant places, so that the compiler
// sees that lanes do not overlap.
template <Index I>
void update_without_first(RingLanes& ring) {
  auto* const rows = &ring.rows[NEIGHBOUR_ROWS * I];
  auto* const next = &ring.rows[NEIGHBOUR_ROWS * (I + 1)];
  auto& tail = ring.tail;
  for (Index k = 0; k < RING_LANES; ++k) {
    const double xx = rows[0][k], xy = rows[1][k], yy = rows[2][k];
    const double ua = rows[3][k], ub = rows[4][k], uc = rows[7][k], ud = rows[8][k], ue = rows[11][k],
                 uf = rows[12][k];
    const double first = xx > 0.0 ? 1.0 / xx : 0.0;
    const double share = xy * first;
    const double rest = yy - xy * share;
    const double second = rest > 0.0 ? 1.0 / rest : 0.0;
    const double va = rows[5][k] - share * ua, vb = rows[6][k] - share * ub, vc = rows[9][k] - share * uc;
    const double vd = rows[10][k] - share * ud, ve = rows[13][k] - share * ue, vf = rows[14][k] - share * uf;
    const double fa = first * ua, fb = first * ub, fc = first * uc, fd = first * ud, fe = first * ue,
                 ff = first * uf;
    const double ga = second * va, gb = second * vb, gc = second * vc, gd = second * vd, ge = second * ve,
                 gf = second * vf;
    next[0][k] -= fa * ua + ga * va;
    next[1][k] -= fa * ub + ga * vb;
    next[2][k] -= fb * ub + gb * vb;
    next[7][k] -= fa * uc + ga * vc;
    next[8][k] -= fa * ud + ga * vd;
    next[9][k] -= fb * uc + gb * vc;
    next[10][k] -= fb * ud + gb * vd;
    next[11][k] -= fa * ue + ga * ve;
    next[12][k] -= fa * uf + ga * vf;
    next[13][k] -= fb * ue + gb * ve;
    next[14][k] -= fb * uf + gb * vf;
    tail[0][k] -= fc * uc + gc * vc;
    tail[1][k] -= fc * ud + gc * vd;
    tail[2][k] -= fd * ud + gd * vd;
    tail[3][k] -= fc * ue + gc * ve;
    tail[4][k] -= fc * uf + gc * vf;
    tail[5][k] -= fd * ue + gd * ve;
    tail[6][k] -= fd * uf + gd * vf;
    tail[7][k] -= fe * ue + ge * ve;
    tail[8][k] -= fe * uf + ge * vf;
    tail[9][k] -= ff * uf + gf * vf;
  }
}

// Eliminates the last neighbours from the middles.
void update_without_last(RingLanes& ring) {
  auto& tail = ring.tail;
  for (Index k = 0; k < RING_LANES; ++k) {
    const double xx = tail[0][k], xy = tail[1][k], yy = tail[2][k], ue = tail[3][k], uf = tail[4][k];
    const double first = xx > 0.0 ? 1.0 / xx : 0.0;
    const double share = xy * first;
    const double rest = yy - xy * share;
    const double second = rest > 0.0 ? 1.0 / rest : 0.0;
    const double ve = tail[5][k] - share * ue, vf = tail[6][k] - share * uf;
    tail[7][k] -= first * ue * ue + second * ve * ve;
    tail[8][k] -= first * ue * uf + second * ve * vf;
    tail[9][k] -= first * uf * uf + second * vf * vf;
  }
}

}  // namespace

void update_without_ring(RingLanes& ring) {
  update_without_first<0>(ring);
  update_without_first<1>(ring);
  update_without_first<2>(ring);
  update_without_first<3>(ring);
  update_without_first<4>(ring);
  update_without_last(ring);
}

}  // namespace cmp::refine
