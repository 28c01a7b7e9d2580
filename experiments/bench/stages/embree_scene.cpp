// SPDX-License-Identifier: MIT
#include "embree_scene.h"

#include <limits>

namespace skeletex {
namespace {

/// Starting Embree takes longer than many a query: once per process.
RTCDevice embree_device() {
  static const struct Owner {
    RTCDevice device = rtcNewDevice(nullptr);
    ~Owner() { rtcReleaseDevice(device); }
  } owner;
  return owner.device;
}

}  // namespace

struct EmbreeScene::Query {
  const EmbreeScene* scene;
  Vec3 point;
  double best;
};

EmbreeScene::EmbreeScene(const std::vector<Vec3>& positions, const std::vector<Triangle>& triangles, Distance distance)
    : positions_(positions), triangles_(triangles), distance_(distance), scene_(rtcNewScene(embree_device())) {
  RTCGeometry geometry = rtcNewGeometry(embree_device(), RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, positions.size()));
  for (const Vec3& p : positions)
    for (int d = 0; d < 3; ++d) *vertices++ = static_cast<float>(p[d]);
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size()));
  for (const Triangle& t : triangles)
    for (const int v : t) *indices++ = static_cast<unsigned>(v);
  if (distance) rtcSetGeometryPointQueryFunction(geometry, visit);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_);
}

bool EmbreeScene::visit(RTCPointQueryFunctionArguments* arguments) {
  auto* query = static_cast<Query*>(arguments->userPtr);
  const EmbreeScene& scene = *query->scene;
  const auto [a, b, c] = scene.triangles_[arguments->primID];
  const double d = scene.distance_(query->point, scene.positions_[a], scene.positions_[b], scene.positions_[c]);
  if (d >= query->best) return false;
  query->best = d;
  arguments->query->radius = static_cast<float>(d * (1 + 1e-6) + 1e-12);  // above d in single precision, too
  return true;
}

double EmbreeScene::closest_distance(const Vec3& point) const {
  Query user{this, point, std::numeric_limits<double>::infinity()};
  RTCPointQuery query{};
  query.x = static_cast<float>(point.x());
  query.y = static_cast<float>(point.y());
  query.z = static_cast<float>(point.z());
  query.radius = std::numeric_limits<float>::infinity();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene_, &query, &context, nullptr, &user);
  return user.best;
}

}  // namespace skeletex
