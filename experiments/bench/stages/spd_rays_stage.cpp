// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "charts.h"
#include "embree_scene.h"
#include "skeletex/convert/layout/pack_atlas.h"
#include "skeletex/convert/parameterize/spd.h"
#include "skeletex/geometry/parallel.h"
#include "stages.h"

namespace skeletex {
namespace {

std::vector<Patch> patches_of(const std::vector<double>& areas, int size) {
  std::vector<PatchRequest> requests;
  for (const double area : areas) requests.push_back({area, 1});
  std::vector<Patch> patches;
  for (const Rectangle& rectangle : pack_atlas(requests, size, size).rectangles) {
    patches.push_back({rectangle, Method::kSpd, SegmentTopology::kAnnulus, {}});
    for (int r = 0; r < rectangle.height; ++r)
      patches.back().row_u.push_back(static_cast<double>(r) / (rectangle.height - 1));
  }
  return patches;
}

struct Ray {
  Vec3 foot, out;
};

struct Rays {
  Rays(ClContext& context, const MeshInput& input, int size) : skeleton(input.skeleton), separation(skeleton) {
    const ChartSet set = charts_of(context, input);
    charts = set.charts;
    patches = patches_of(set.areas, size);
    distances.resize(charts.size());
    for (std::size_t i = 0; i < patches.size(); ++i) {
      std::vector<Ray>& list = rays.emplace_back();
      for (const double u : patches[i].row_u)
        for (int j = 0; j < patches[i].rectangle.width; ++j) {
          const TangentFrame frame = tangent_frame(skeleton, separation, charts[i].bone, u,
                                                   static_cast<double>(j) / patches[i].rectangle.width);
          list.push_back({frame.foot, frame.out});
        }
      distances[i].resize(list.size());
    }
  }

  Skeleton skeleton;
  SeparationPlanes separation;
  std::vector<Chart> charts;
  std::vector<Patch> patches;
  std::vector<std::vector<Ray>> rays;
  std::vector<SpdHits> hits;
  std::vector<std::vector<float>> distances;  ///< Embree's; 0 for a miss
};

void intersect_coherent(const int* valid, RTCScene scene, RTCRayHit8& packet) {
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect8(valid, scene, &packet, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect8(valid, scene, &context, &packet);
#endif
}

/// Rays [begin, end) in packets of eight.
void cast_packets(RTCScene scene, const std::vector<Ray>& rays, std::size_t begin, std::size_t end,
                  std::vector<float>& distances) {
  for (std::size_t k = begin; k < end; k += 8) {
    alignas(32) int valid[8];
    RTCRayHit8 packet{};
    for (std::size_t lane = 0; lane < 8; ++lane) {
      valid[lane] = k + lane < end ? -1 : 0;
      const Ray& ray = rays[std::min(k + lane, end - 1)];
      packet.ray.org_x[lane] = static_cast<float>(ray.foot.x());
      packet.ray.org_y[lane] = static_cast<float>(ray.foot.y());
      packet.ray.org_z[lane] = static_cast<float>(ray.foot.z());
      packet.ray.dir_x[lane] = static_cast<float>(ray.out.x());
      packet.ray.dir_y[lane] = static_cast<float>(ray.out.y());
      packet.ray.dir_z[lane] = static_cast<float>(ray.out.z());
      packet.ray.tfar[lane] = std::numeric_limits<float>::infinity();
      packet.ray.mask[lane] = ~0u;
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
    }
    intersect_coherent(valid, scene, packet);
    for (std::size_t lane = 0; lane < 8 && k + lane < end; ++lane)
      distances[k + lane] = packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID ? 0 : packet.ray.tfar[lane];
  }
}

}  // namespace

Stage spd_rays_stage(ClContext& context, MeshInputPointer input, int size) {
  Stage stage;
  stage.name = "spd_rays";
  stage.model = input->name;
  stage.size = size;
  stage.reference = "Embree's rtcIntersect8 of the same rays on all threads";
  const auto shared = std::make_shared<Rays>(context, *input, size);
  stage.run = [&context, shared] {
    shared->hits =
        cast_spd_rays(context, shared->skeleton, shared->separation, shared->charts, shared->patches, SpdHit::kFirst);
  };
  // Each time holds what a new model needs: lists of triangles here, trees there. Embree is given its rays, ours are
  // made on the way.
  stage.run_reference = [shared] {
    return wall_ms([&] {
      for (std::size_t i = 0; i < shared->charts.size(); ++i) {
        const EmbreeScene scene(shared->charts[i].positions, shared->charts[i].triangles);
        for_each_block(shared->rays[i].size(), 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
          cast_packets(scene.handle(), shared->rays[i], begin, end, shared->distances[i]);
        });
      }
    });
  };
  // Both must have found the same surface; rays along seams and edges may fall either way.
  stage.details = [shared] {
    double same = 0, rays = 0;
    for (std::size_t i = 0; i < shared->hits.size(); ++i)
      for (std::size_t k = 0; k < shared->distances[i].size(); ++k, ++rays)
        same += std::abs(shared->distances[i][k] - shared->hits[i].distances[k]) <= 1e-4f * shared->distances[i][k];
    return std::vector<std::pair<std::string, double>>{{"rays", rays}, {"same_share", same / rays}};
  };
  return stage;
}

}  // namespace skeletex
