// SPDX-License-Identifier: MIT
#include "skeletex/render/gpu_surface.h"

#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>

#include <algorithm>

namespace skeletex {

GpuSurface upload_surface(GlContext& context, const TriangleMesh& mesh) {
  GpuSurface surface;
  surface.vertex_count = static_cast<int>(mesh.positions.size());
  surface.triangle_count = static_cast<int>(mesh.triangles.size());
  surface.origin = bounding_box(mesh).centre();
  std::vector<std::array<float, 3>> positions;
  positions.reserve(mesh.positions.size());
  for (const Vec3& p : mesh.positions) {
    const Eigen::Vector3f q = (p - surface.origin).cast<float>();
    positions.push_back({q.x(), q.y(), q.z()});
  }
  std::vector<int> begin(mesh.positions.size() + 1, 0), incident(3 * mesh.triangles.size());
  for (const Triangle& t : mesh.triangles)
    for (const int v : t) ++begin[v + 1];
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) begin[v + 1] += begin[v];
  std::vector<int> next(begin.begin(), begin.end() - 1);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const int v : mesh.triangles[t]) incident[next[v]++] = static_cast<int>(t);
  surface.positions = gl_buffer(positions);
  surface.normals = GlBuffer(surface.positions.bytes());
  surface.indices = gl_buffer(mesh.triangles);
  surface.incident_begin = gl_buffer(begin);
  surface.incident = gl_buffer(incident);
  update_normals(context, surface);
  return surface;
}

void update_normals(GlContext& context, GpuSurface& surface) {
  if (surface.vertex_count == 0) return;
  glUseProgram(context.program({"normals.comp"}));
  surface.positions.bind(0);
  surface.indices.bind(1);
  surface.incident_begin.bind(2);
  surface.incident.bind(3);
  surface.normals.bind(4);
  glUniform1i(0, surface.vertex_count);
  const int groups = (surface.vertex_count + 63) / 64, columns = std::min(groups, 32768);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  glDispatchCompute(columns, (groups + columns - 1) / columns, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
  check_gl("normals");
}

void write_normals(GpuSurface& surface, std::span<const Vec3> normals) {
  std::vector<Eigen::Vector3f> values;
  values.reserve(normals.size());
  for (const Vec3& normal : normals) values.push_back(normal.cast<float>());
  surface.normals = gl_buffer(values);
}

std::vector<Vec3> download_positions(const GpuSurface& surface) {
  std::vector<float> values(3 * static_cast<std::size_t>(surface.vertex_count));
  surface.positions.read(values.size() * sizeof(float), values.data());
  std::vector<Vec3> positions(surface.vertex_count);
  for (std::size_t i = 0; i < positions.size(); ++i)
    positions[i] = surface.origin + Vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  return positions;
}

}  // namespace skeletex
