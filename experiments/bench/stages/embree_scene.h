// SPDX-License-Identifier: MIT
#pragma once
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <vector>

#include "skeletex/geometry/mesh.h"

namespace skeletex {

/// Embree's tree over some triangles, which must outlive it.
class EmbreeScene {
 public:
  /// Distance of a point from a triangle.
  using Distance = double (*)(const Vec3& point, const Vec3& a, const Vec3& b, const Vec3& c);

  /// \param distance  what closest_distance takes at the tree's leaves; null where there are rays only
  EmbreeScene(const std::vector<Vec3>& positions, const std::vector<Triangle>& triangles, Distance distance = nullptr);
  ~EmbreeScene() { rtcReleaseScene(scene_); }
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  RTCScene handle() const { return scene_; }
  /// From a point to the nearest triangle, by a point query.
  double closest_distance(const Vec3& point) const;

 private:
  struct Query;
  static bool visit(RTCPointQueryFunctionArguments* arguments);

  const std::vector<Vec3>& positions_;
  const std::vector<Triangle>& triangles_;
  Distance distance_;
  RTCScene scene_;
};

}  // namespace skeletex
