// SPDX-License-Identifier: MIT
// Rays of the separation planes' map: rays per second of all charts of a model, and beside it Embree's packets of eight
// coherent rays on all processors, in the same run and with the same rays. Each time holds what a new model needs (lists
// of triangles, Embree's trees); Embree is given its rays, ours are made on the way.
#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>

#include "skeletex/io/mesh_file.h"
#include "skeletex/io/model_config.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/measure/parallel.h"
#include "skeletex/pack/pack_atlas.h"
#include "skeletex/parameterize/spd.h"
#include "skeletex/segment/segment_mesh.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

struct Model {
  Skeleton skeleton;
  std::unique_ptr<Walls> walls;
  std::vector<Chart> charts;
  std::vector<double> areas;
};

const Model& model(const std::string& name) {
  static std::map<std::string, Model> models;
  auto it = models.find(name);
  if (it != models.end()) return it->second;
  const ModelConfig config = read_model_config(SKELETEX_SOURCE_DIR "/configs/models/" + name + ".json");
  Model& made = models[name];
  made.skeleton = read_skeleton(config.skeleton);
  made.walls = std::make_unique<Walls>(made.skeleton);
  const Segmentation segmentation = segment_mesh(context(), build_half_edges(read_mesh(config.mesh).mesh), made.skeleton);
  for (const Segment& segment : segmentation.segments) {
    made.charts.push_back(make_chart(segment, made.skeleton, *made.walls));
    made.areas.push_back(surface_area(segment.mesh));
  }
  return made;
}

std::vector<Patch> patches_of(const Model& model, int size) {
  std::vector<PatchDemand> demands;
  for (const double area : model.areas) demands.push_back({area, 1});
  std::vector<Patch> patches;
  for (const Rectangle& rectangle : pack_atlas(demands, size, size).rectangles) {
    patches.push_back({rectangle, Method::kSpd, SegmentTopology::kAnnulus, {}});
    for (int r = 0; r < rectangle.height; ++r) patches.back().row_u.push_back(static_cast<double>(r) / (rectangle.height - 1));
  }
  return patches;
}

/// Rates by name, so that the second of two benchmarks can say how it compares to the first.
std::map<std::string, double>& rates() {
  static std::map<std::string, double> kept;
  return kept;
}

class RateOfRays {
 public:
  RateOfRays(benchmark::State& state, std::string name, std::size_t rays) : state_(state), name_(std::move(name)), rays_(static_cast<double>(rays)) {}
  ~RateOfRays() {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count() / static_cast<double>(state_.iterations());
    rates()[name_] = rays_ / seconds;
    state_.counters["rays/s"] = rays_ / seconds;
  }

 private:
  benchmark::State& state_;
  std::string name_;
  double rays_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void rays(benchmark::State& state, const std::string& name, SpdHit which) {
  const Model& m = model(name);
  const int size = static_cast<int>(state.range(0));
  const std::vector<Patch> patches = patches_of(m, size);
  cast_spd_rays(context(), m.skeleton, *m.walls, m.charts, patches, which);
  context().reset_profile();
  {
    const RateOfRays rate(state, fmt::format("{}/{}", name, size), static_cast<std::size_t>(size) * size);
    for (auto _ : state) benchmark::DoNotOptimize(cast_spd_rays(context(), m.skeleton, *m.walls, m.charts, patches, which).data());
  }
  for (const ClProfileEntry& entry : context().profile())
    if (entry.kernel == "spd.cl:cast_rays") state.counters["device_ms"] = entry.milliseconds / entry.launches;
}

struct Ray {
  Vec3 foot, out;
};

void embree(benchmark::State& state, const std::string& name) {
  const Model& m = model(name);
  const int size = static_cast<int>(state.range(0));
  const std::vector<Patch> patches = patches_of(m, size);
  std::vector<std::vector<Ray>> all_rays(patches.size());
  for (std::size_t i = 0; i < patches.size(); ++i)
    for (const double u : patches[i].row_u)
      for (int j = 0; j < patches[i].rectangle.width; ++j) {
        const TangentFrame frame = tangent_frame(m.skeleton, *m.walls, m.charts[i].bone, u, static_cast<double>(j) / patches[i].rectangle.width);
        all_rays[i].push_back({frame.foot, frame.out});
      }
  const std::vector<SpdHits> hits = cast_spd_rays(context(), m.skeleton, *m.walls, m.charts, patches, SpdHit::kFirst);
  std::vector<std::vector<float>> distances(patches.size());
  RTCDevice device = rtcNewDevice(nullptr);
  {
    const RateOfRays rate(state, fmt::format("{}/{}/embree", name, size), static_cast<std::size_t>(size) * size);
    for (auto _ : state)
      for (std::size_t i = 0; i < patches.size(); ++i) {
        const Chart& chart = m.charts[i];
        RTCScene scene = rtcNewScene(device);
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, chart.positions.size()));
        for (const Vec3& p : chart.positions)
          for (int d = 0; d < 3; ++d) *vertices++ = static_cast<float>(p[d]);
        auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, chart.triangles.size()));
        for (const Triangle& t : chart.triangles)
          for (const int v : t) *indices++ = static_cast<unsigned>(v);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene);
        const std::vector<Ray>& chart_rays = all_rays[i];
        distances[i].resize(chart_rays.size());
        for_each_block(chart_rays.size(), 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
          RTCIntersectContext intersect;
          rtcInitIntersectContext(&intersect);
          intersect.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
          for (std::size_t k = begin; k < end; k += 8) {
            alignas(32) int valid[8];
            RTCRayHit8 packet{};
            for (std::size_t lane = 0; lane < 8; ++lane) {
              valid[lane] = k + lane < end ? -1 : 0;
              const Ray& ray = chart_rays[std::min(k + lane, end - 1)];
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
            rtcIntersect8(valid, scene, &intersect, &packet);
            for (std::size_t lane = 0; lane < 8 && k + lane < end; ++lane)
              distances[i][k + lane] = packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID ? 0 : packet.ray.tfar[lane];
          }
        });
        rtcReleaseScene(scene);
      }
  }
  rtcReleaseDevice(device);
  // Both must have found the same surface; rays along seams and edges may fall either way.
  std::size_t same = 0, ours = 0, theirs = 0;
  for (std::size_t i = 0; i < patches.size(); ++i)
    for (std::size_t k = 0; k < distances[i].size(); ++k) {
      same += std::abs(distances[i][k] - hits[i].distances[k]) <= 1e-4f * distances[i][k];
      ours += hits[i].triangles[k] < 0;
      theirs += distances[i][k] == 0;
    }
  state.counters["same_share"] = static_cast<double>(same) / (static_cast<double>(size) * size);
  state.counters["misses_embree"] = static_cast<double>(theirs);
  state.counters["misses_ours"] = static_cast<double>(ours);
  const std::string key = fmt::format("{}/{}", name, size);
  if (rates().contains(key)) state.counters["ours_over_embree"] = rates()[key] / rates()[key + "/embree"];
}

void unseen(benchmark::State& state, const std::string& name) {
  const Model& m = model(name);
  for (auto _ : state) benchmark::DoNotOptimize(unseen_area_fractions(context(), m.skeleton, *m.walls, m.charts).data());
  std::size_t triangles = 0;
  for (const Chart& chart : m.charts) triangles += chart.triangles.size();
  state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(triangles), benchmark::Counter::kIsIterationInvariantRate);
}

}  // namespace
}  // namespace skeletex

int main(int argc, char** argv) {
  using namespace skeletex;
  for (const std::string name : {"bunny00", "armadillo", "bear"}) {
    if (!std::filesystem::exists(SKELETEX_SOURCE_DIR "/build/meshes/" + name + ".off")) continue;
    for (const int size : {512, 2048}) {
      benchmark::RegisterBenchmark(("spd/rays/" + name).c_str(), rays, name, SpdHit::kFirst)->Arg(size)->UseRealTime()->Unit(benchmark::kMillisecond);
      benchmark::RegisterBenchmark(("spd/embree/" + name).c_str(), embree, name)->Arg(size)->UseRealTime()->Unit(benchmark::kMillisecond);
    }
    benchmark::RegisterBenchmark(("spd/unseen/" + name).c_str(), unseen, name)->UseRealTime()->Unit(benchmark::kMillisecond);
  }
  benchmark::AddCustomContext("device", context().device().name);
  benchmark::AddCustomContext("driver", context().device().driver);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
