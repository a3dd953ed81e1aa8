#include "cells/cell_mesh.hpp"

#include <cmath>
#include <vector>

#include "numeric/median.hpp"
#include "numeric/nearest_points.hpp"

namespace cmp::cells {

namespace {

constexpr int CORNERS = 3;

struct Vector {
  double x, y;

  double square() const { return x * x + y * y; }
  friend Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y}; }
};

// The number of the step by which a neighbour shares corner i, where the neighbour's place is that of corner
// j.
constexpr Index step_of(int i, int j) {
  for (Index k = 0; k < STEPS; ++k)
    if (STEP_CORNERS[k][0] == i && STEP_CORNERS[k][1] == j) return k;
  return -1;
}

// Two corners that may be one, and the step between their cells.
struct Contact {
  std::int32_t from, to;
  std::int8_t step, back;
};

// The triangles of N cells, about their centres.
class Triangles {
 public:
  Triangles(View<const double, 2> centre, View<const double, 3> corner)
      : centre_(centre),
        corner_(corner.shape()),
        edge_({centre.size()}),
        points_({CORNERS * centre.size(), 2}) {
    for (Index i = 0; i < centre.size(); ++i) {
      for (int k = 0; k < CORNERS; ++k)
        for (int axis = 0; axis < 2; ++axis) {
          corner_(i, k, axis) = corner(i, k, axis) - centre(i, axis);
          points_(CORNERS * i + k, axis) = corner(i, k, axis);
        }
      const Vector u = at(i, 1) - at(i, 0), v = at(i, 2) - at(i, 0);
      edge_[i] = std::sqrt(std::abs(u.x * v.y - u.y * v.x) * 2.0 / std::sqrt(3.0));
    }
  }

  // The contacts of corners that are nearer than the tolerance, in edges.
  std::vector<Contact> contacts(double tolerance, double direction_tolerance) const {
    const auto grid = numeric::bucket_grid(points_);
    std::vector<Contact> out;
    for (Index point = 0; point < points_.size(); ++point) {
      const Index i = point / CORNERS;
      numeric::for_points_within(grid, points_(point, 0), points_(point, 1), tolerance * edge_[i],
                                 [&](std::int32_t near, double square) {
                                   const Index other = near / CORNERS;
                                   const double reach = tolerance * edge_[other];
                                   if (other != i && square < reach * reach)
                                     add_contact(out, i, static_cast<int>(point % CORNERS), other,
                                                 near % CORNERS, direction_tolerance);
                                 });
    }
    return out;
  }
  // The square of the distance between the corners of a contact, in edges of the smaller cell, of triangles
  // without a swelling.
  double squared_misfit(const Contact& contact, double swelling) const {
    const Vector own = at(contact.from, STEP_CORNERS[contact.step][0]), way = way_of(contact);
    const Vector other = at(contact.to, STEP_CORNERS[contact.back][0]);
    const Vector gap{way.x - (own.x - other.x) / swelling, way.y - (own.y - other.y) / swelling};
    const double edge = std::min(edge_[contact.from], edge_[contact.to]);
    return gap.square() / (edge * edge);
  }
  // The distance of two cells at which their triangles would just meet, over their distance.
  double swelling(const Contact& contact) const {
    const Vector met =
        at(contact.from, STEP_CORNERS[contact.step][0]) - at(contact.to, STEP_CORNERS[contact.back][0]);
    const Vector way = way_of(contact);
    return (met.x * way.x + met.y * way.y) / std::max(way.x * way.x + way.y * way.y, 1e-12);
  }

 private:
  Vector at(Index i, Index k) const { return {corner_(i, k, 0), corner_(i, k, 1)}; }
  Vector way_of(const Contact& c) const {
    return {centre_(c.to, 0) - centre_(c.from, 0), centre_(c.to, 1) - centre_(c.from, 1)};
  }
  // The square of the neighbour's distance from where the cell's own triangle expects it, px^2.
  double direction_misfit(Index i, Index shared, Index from, Vector way) const {
    return (way - (at(i, shared) - at(i, from))).square();
  }
  void add_contact(std::vector<Contact>& out, Index i, int own, Index other, Index shared,
                   double direction_tolerance) const {
    const Vector way{centre_(other, 0) - centre_(i, 0), centre_(other, 1) - centre_(i, 1)};
    const int a = (own + 1) % CORNERS, b = (own + 2) % CORNERS;
    const double at_a = direction_misfit(i, own, a, way), at_b = direction_misfit(i, own, b, way);
    const int place = at_a < at_b ? a : b;
    // the neighbour's corner `shared` is the lattice's corner `place`; the others follow in the same order
    const auto back = static_cast<int>((shared + own - place + CORNERS) % CORNERS);
    const double reverse = direction_misfit(other, shared, back, {-way.x, -way.y});
    const double reach = direction_tolerance * edge_[i], back_reach = direction_tolerance * edge_[other];
    if (std::min(at_a, at_b) > reach * reach || reverse > back_reach * back_reach) return;
    out.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(other),
                   static_cast<std::int8_t>(step_of(own, place)),
                   static_cast<std::int8_t>(step_of(static_cast<int>(shared), back))});
  }

  View<const double, 2> centre_;
  Array<double, 3> corner_;
  Array<double, 1> edge_;
  Array<double, 2> points_;
};

// The best contact at each step of each cell (N, 6), or -1; only where both cells agree.
class MutualContacts {
 public:
  MutualContacts(const Triangles& triangles, const std::vector<Contact>& contacts, Index cells,
                 double swelling, double tolerance)
      : best_({cells, STEPS}, -1), misfit_({cells, STEPS}, tolerance * tolerance), contacts_(contacts) {
    for (std::size_t n = 0; n < contacts.size(); ++n) {
      const Contact& one = contacts[n];
      const double misfit = triangles.squared_misfit(one, swelling);
      if (misfit >= misfit_(one.from, one.step)) continue;
      misfit_(one.from, one.step) = misfit;
      best_(one.from, one.step) = static_cast<std::int32_t>(n);
    }
  }
  // The contact at a step; null for none.
  const Contact* at(Index i, Index step) const {
    const std::int32_t n = best_(i, step);
    if (n < 0) return nullptr;
    const Contact& one = contacts_[static_cast<std::size_t>(n)];
    const std::int32_t other = best_(one.to, one.back);
    if (other < 0) return nullptr;
    const Contact& reverse = contacts_[static_cast<std::size_t>(other)];
    return reverse.to == i && reverse.back == step ? &one : nullptr;
  }
  double misfit(Index i, Index step) const { return std::sqrt(misfit_(i, step)); }

 private:
  Array<std::int32_t, 2> best_;
  Array<double, 2> misfit_;  // the squares
  const std::vector<Contact>& contacts_;
};

// The median swelling at mutual contacts; 1 without any.
double swelling_of(const Triangles& triangles, const MutualContacts& contacts, Index cells) {
  std::vector<double> ratios;
  for (Index i = 0; i < cells; ++i)
    for (Index k = 0; k < STEPS; ++k)
      if (const Contact* one = contacts.at(i, k)) ratios.push_back(triangles.swelling(*one));
  if (ratios.empty()) return 1.0;
  return numeric::median_of_many(View<double, 1>(ratios.data(), {static_cast<Index>(ratios.size())}));
}

}  // namespace

LinkedCells link_cells(View<const double, 2> centre, View<const double, 3> corner,
                       const CellMeshLimits& limits) {
  const Index count = centre.size();
  Array<std::int32_t, 2> neighbours({count, STEPS}, -1);
  Array<std::int8_t, 2> back({count, STEPS}, std::int8_t{-1});
  Array<double, 2> misfit({count, STEPS}, 0.0);
  double swelling = 1.0;
  if (count > 1) {
    const Triangles triangles(centre, corner);
    const auto contacts = triangles.contacts(limits.first_tolerance, limits.direction_tolerance);
    const MutualContacts first(triangles, contacts, count, 1.0, limits.first_tolerance);
    swelling =
        std::min(std::max(swelling_of(triangles, first, count), limits.min_swelling), limits.max_swelling);
    const MutualContacts mutual(triangles, contacts, count, swelling, limits.tolerance);
    for (Index i = 0; i < count; ++i)
      for (Index k = 0; k < STEPS; ++k) {
        const Contact* one = mutual.at(i, k);
        if (one == nullptr) continue;
        neighbours(i, k) = one->to;
        back(i, k) = one->back;
        misfit(i, k) = mutual.misfit(i, k);
      }
  }
  return {CellLinks{std::move(neighbours), std::move(back), std::move(misfit)}, swelling};
}

}  // namespace cmp::cells
