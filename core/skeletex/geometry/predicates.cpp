// SPDX-License-Identifier: MIT
#include "skeletex/geometry/predicates.h"

#include <cmath>
#include <limits>

namespace skeletex {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon() / 2;  // as Shewchuk counts it

int sign_of(double value, double bound) { return value > bound ? 1 : value < -bound ? -1 : 0; }

}  // namespace

int orientation(const Vec2& a, const Vec2& b, const Vec2& c) {
  const double left = (a.x() - c.x()) * (b.y() - c.y()), right = (a.y() - c.y()) * (b.x() - c.x());
  return sign_of(left - right, (3 + 16 * kEpsilon) * kEpsilon * (std::abs(left) + std::abs(right)));
}

int orientation(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 p = a - d, q = b - d, r = c - d;
  const double qr = q.x() * r.y(), rq = r.x() * q.y(), rp = r.x() * p.y(), pr = p.x() * r.y(), pq = p.x() * q.y(),
               qp = q.x() * p.y();
  const double value = p.z() * (qr - rq) + q.z() * (rp - pr) + r.z() * (pq - qp);
  const double size = (std::abs(qr) + std::abs(rq)) * std::abs(p.z()) +
                      (std::abs(rp) + std::abs(pr)) * std::abs(q.z()) + (std::abs(pq) + std::abs(qp)) * std::abs(r.z());
  return sign_of(value, (7 + 56 * kEpsilon) * kEpsilon * size);
}

}  // namespace skeletex
