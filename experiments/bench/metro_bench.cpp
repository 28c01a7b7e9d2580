// SPDX-License-Identifier: MIT
// Closest points: queries per second on the device, and beside it Embree's point queries on all processors in the same
// run. Queries come along a Hilbert curve for both.
#include <benchmark/benchmark.h>
#include <embree3/rtcore.h>

#include <filesystem>
#include <map>
#include <random>

#include "skeletex/io/mesh_file.h"
#include "skeletex/measure/hilbert_order.h"
#include "skeletex/measure/manifold.h"
#include "skeletex/measure/metro.h"
#include "skeletex/measure/parallel.h"
#include "skeletex/measure/point_triangle.h"
#include "skeletex/measure/triangle_tree.h"

namespace skeletex {
namespace {

ClContext& context() {
  static ClContext instance;
  return instance;
}

const TriangleMesh& model(const std::string& name) {
  static std::map<std::string, TriangleMesh> models;
  auto it = models.find(name);
  if (it == models.end()) it = models.emplace(name, read_mesh(SKELETEX_SOURCE_DIR "/build/meshes/" + name + ".off").mesh).first;
  return it->second;
}

/// Points near a mesh, as the vertices of a reconstruction are; 16 per triangle, along a curve.
std::vector<Vec3> points_near(const TriangleMesh& mesh, double noise_rel_diag) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(0, 1);
  std::normal_distribution<double> noise(0, noise_rel_diag * bounding_box(mesh).diagonal());
  std::vector<Vec3> points;
  for (const auto& [a, b, c] : mesh.triangles)
    for (int k = 0; k < 16; ++k) {
      const double s = share(random), t = share(random) * (1 - s);
      points.push_back(mesh.positions[a] + s * (mesh.positions[b] - mesh.positions[a]) + t * (mesh.positions[c] - mesh.positions[a]) +
                       Vec3(noise(random), noise(random), noise(random)));
    }
  std::vector<Vec3> sorted;
  for (const int i : hilbert_order(points)) sorted.push_back(points[i]);
  return sorted;
}

double noise_of(const benchmark::State& state) { return std::pow(10, -static_cast<double>(state.range(0))); }

void report_rate(benchmark::State& state, std::size_t points) {
  state.counters["queries/s"] = benchmark::Counter(static_cast<double>(points), benchmark::Counter::kIsIterationInvariantRate);
}

void closest(benchmark::State& state, const std::string& name) {
  const TriangleMesh& mesh = model(name);
  const std::vector<Vec3> points = points_near(mesh, noise_of(state));
  closest_distances(context(), mesh, points);
  context().reset_profile();
  for (auto _ : state) benchmark::DoNotOptimize(closest_distances(context(), mesh, points).data());
  report_rate(state, points.size());
  double device_ms = 0;
  for (const ClProfileEntry& entry : context().profile()) device_ms += entry.milliseconds;
  state.counters["device_ms"] = device_ms / static_cast<double>(state.iterations());
}

struct EmbreeQuery {
  const TriangleMesh* mesh;
  Vec3 point;
  double best;
};

bool visit_triangle(RTCPointQueryFunctionArguments* arguments) {
  auto* query = static_cast<EmbreeQuery*>(arguments->userPtr);
  const auto [a, b, c] = query->mesh->triangles[arguments->primID];
  const double d = offset_from_triangle(query->point, query->mesh->positions[a], query->mesh->positions[b], query->mesh->positions[c]).norm();
  if (d >= query->best) return false;
  query->best = d;
  arguments->query->radius = static_cast<float>(d * (1 + 1e-6));
  return true;
}

void embree(benchmark::State& state, const std::string& name) {
  const TriangleMesh& mesh = model(name);
  const std::vector<Vec3> points = points_near(mesh, noise_of(state));
  std::vector<double> distances(points.size());
  RTCDevice device = rtcNewDevice(nullptr);
  for (auto _ : state) {
    RTCScene scene = rtcNewScene(device);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.positions.size()));
    for (const Vec3& p : mesh.positions)
      for (int d = 0; d < 3; ++d) *vertices++ = static_cast<float>(p[d]);
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.triangles.size()));
    for (const Triangle& t : mesh.triangles)
      for (const int v : t) *indices++ = static_cast<unsigned>(v);
    rtcSetGeometryPointQueryFunction(geometry, visit_triangle);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    for_each_block(points.size(), 4096, [&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        EmbreeQuery user{&mesh, points[i], std::numeric_limits<double>::infinity()};
        RTCPointQuery query{};
        query.x = static_cast<float>(points[i].x());
        query.y = static_cast<float>(points[i].y());
        query.z = static_cast<float>(points[i].z());
        query.radius = std::numeric_limits<float>::infinity();
        RTCPointQueryContext query_context;
        rtcInitPointQueryContext(&query_context);
        rtcPointQuery(scene, &query, &query_context, nullptr, &user);
        distances[i] = user.best;
      }
    });
    rtcReleaseScene(scene);
  }
  rtcReleaseDevice(device);
  report_rate(state, points.size());
}

void tree(benchmark::State& state, const std::string& name) {
  for (auto _ : state) benchmark::DoNotOptimize(build_triangle_tree(model(name)).order.data());
  state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(model(name).triangles.size()), benchmark::Counter::kIsIterationInvariantRate);
}

void manifold(benchmark::State& state, const std::string& name) {
  for (auto _ : state) benchmark::DoNotOptimize(measure_manifold(model(name)).genus);
  state.counters["triangles/s"] = benchmark::Counter(static_cast<double>(model(name).triangles.size()), benchmark::Counter::kIsIterationInvariantRate);
}

}  // namespace
}  // namespace skeletex

int main(int argc, char** argv) {
  using namespace skeletex;
  for (const std::string name : {"bunny00", "armadillo"}) {
    if (!std::filesystem::exists(SKELETEX_SOURCE_DIR "/build/meshes/" + name + ".off")) continue;
    // The argument is the distance from the surface: 10^-n diagonals.
    for (const int digits : {1, 3, 5}) {
      benchmark::RegisterBenchmark(("metro/closest/" + name).c_str(), closest, name)->Arg(digits)->UseRealTime()->Unit(benchmark::kMillisecond);
      benchmark::RegisterBenchmark(("metro/embree/" + name).c_str(), embree, name)->Arg(digits)->UseRealTime()->Unit(benchmark::kMillisecond);
    }
    benchmark::RegisterBenchmark(("metro/tree/" + name).c_str(), tree, name)->UseRealTime()->Unit(benchmark::kMillisecond);
    benchmark::RegisterBenchmark(("metro/manifold/" + name).c_str(), manifold, name)->UseRealTime()->Unit(benchmark::kMillisecond);
  }
  benchmark::AddCustomContext("device", context().device().name);
  benchmark::AddCustomContext("driver", context().device().driver);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
