// SPDX-License-Identifier: MIT
#include "skeletex/render/gpu_model.h"

#define GL_GLEXT_PROTOTYPES
#include <GL/glcorearb.h>

#include <algorithm>

#include "skeletex/model/frame.h"
#include "skeletex/reconstruct/displace.h"
#include "skeletex/reconstruct/pose/pose_mesh.h"
#include "skeletex/reconstruct/pose/posed_frame.h"

namespace skeletex {
namespace {

/// Planes behind each other, as displace.comp reads them.
template <typename Record>
GlBuffer upload_planes(const std::vector<Record>& records) {
  static_assert(sizeof(Record) == 4 * sizeof(float));
  std::vector<float> planes(4 * records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const auto values = std::bit_cast<std::array<float, 4>>(records[i]);
    for (std::size_t k = 0; k < 4; ++k) planes[k * records.size() + i] = values[k];
  }
  return gl_buffer(planes);
}

std::vector<std::array<float, 3>> relative_positions(std::span<const Vec3> positions, const Vec3& origin) {
  std::vector<std::array<float, 3>> relative;
  relative.reserve(positions.size());
  for (const Vec3& position : positions) {
    const Eigen::Vector3f p = (position - origin).cast<float>();
    relative.push_back({p.x(), p.y(), p.z()});
  }
  return relative;
}

/// Poles, seam samples and corners: the vertices behind the inner ones.
void write_shared_vertices(std::span<const Vec3> positions, int inner_count, GpuSurface& surface) {
  const auto shared = relative_positions(positions.subspan(inner_count), surface.origin);
  surface.positions.write(inner_count * sizeof(shared[0]), shared.size() * sizeof(shared[0]), shared.data());
}

}  // namespace

GpuModel upload_model(const PreparedModel& prepared) {
  const SkeletexModel& model = prepared.model;
  GpuModel device;
  const DisplacementTexture& texture = model.texture;
  std::vector<std::array<float, 3>> texels(texture.along.size());
  for (std::size_t i = 0; i < texels.size(); ++i) texels[i] = {texture.along[i], texture.around[i], texture.out[i]};
  device.texels = GlTexture(GL_RGB32F, texture.width, texture.height);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  glTextureSubImage2D(device.texels.id(), 0, 0, 0, texture.width, texture.height, GL_RGB, GL_FLOAT, texels.data());
  device.lattice_rows = gl_buffer(prepared.inner_rows);
  device.row_count = static_cast<int>(prepared.inner_rows.size());
  device.rows = gl_buffer(prepared.tables.rows);
  device.columns = upload_planes(prepared.tables.columns);
  device.column_count = static_cast<int>(prepared.tables.columns.size());
  for (const Patch& patch : model.patches) device.widest = std::max(device.widest, patch.rectangle.width);
  check_gl("a model");
  return device;
}

void displace(GlContext& context, const GpuModel& device, const PreparedModel& model, const Skeleton& posed,
              DistanceRule rule, GpuSurface& surface) {
  const PosedPlanes separation(model.model, posed);
  const PoseTables tables = pose_tables(model.model, separation);
  const GlBuffer patches = gl_buffer(tables.patches), rows = gl_buffer(tables.rows),
                 columns = upload_planes(tables.columns);
  surface.origin = tables.origin;
  glUseProgram(context.program({"displace.comp"}));
  glBindTextureUnit(0, device.texels.id());
  surface.positions.bind(0);
  device.lattice_rows.bind(1);
  patches.bind(2);
  device.rows.bind(3);
  rows.bind(4);
  device.columns.bind(5);
  columns.bind(6);
  glUniform1i(0, device.column_count);
  glUniform1i(1, rule == DistanceRule::kFromBone ? 1 : 0);
  glDispatchCompute((device.widest + 63) / 64, device.row_count, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);

  std::vector<Vec3> points(model.lattice.vertex_count);
  place_shared_vertices(model, separation, rule, points);
  write_shared_vertices(points, model.lattice.inner_count, surface);
  check_gl("displacing");
  update_normals(context, surface);
}

GpuSkin upload_skin(const Skin& skin, const TriangleMesh& bind) {
  GpuSkin device;
  device.blocks = gl_buffer(skin.blocks);
  device.block_bones = gl_buffer(skin.block_bones);
  device.weights = gl_buffer(skin.weights);
  device.bind_positions = gl_buffer(relative_positions(std::span(bind.positions).first(skin.inner_count), skin.origin));
  check_gl("weights");
  return device;
}

void pose_skin(GlContext& context, const GpuSkin& device, const Skin& skin, std::span<const BoneMotion> motions,
               const Skeleton& posed, GpuSurface& surface) {
  surface.origin = middle_of_nodes(posed);
  const GlBuffer records = gl_buffer(motion_records(motions, skin.origin, surface.origin));
  glUseProgram(context.program({"skin.comp"}));
  surface.positions.bind(0);
  device.bind_positions.bind(1);
  device.blocks.bind(2);
  device.block_bones.bind(3);
  device.weights.bind(4);
  records.bind(5);
  const int blocks = static_cast<int>(skin.blocks.size()), columns = std::min(blocks, 32768);
  glUniform1i(0, blocks);
  if (blocks > 0) glDispatchCompute(columns, (blocks + columns - 1) / columns, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  std::vector<Vec3> points(skin.inner_count + skin.shared_points.size());
  pose_shared_vertices(skin, motions, points);
  write_shared_vertices(points, skin.inner_count, surface);
  check_gl("posing");
  update_normals(context, surface);
}

}  // namespace skeletex
