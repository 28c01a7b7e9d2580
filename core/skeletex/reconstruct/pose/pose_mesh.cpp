// SPDX-License-Identifier: MIT
#include "skeletex/reconstruct/pose/pose_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "reconstruct_structs.h"
#include "skeletex/model/error.h"
#include "skeletex/reconstruct/lattice.h"
#include "skeletex/reconstruct/pose/linear_skin.h"
#include "skeletex/reconstruct/pose/pose_by_coordinates.h"
#include "skeletex/reconstruct/pose/skin.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"

namespace skeletex {
DevicePose upload_pose(ClContext& context, const PreparedModel& model, const PosedPlanes& posed, RowChoice choice,
                       DistanceRule rule) {
  const PoseTables tables = pose_tables(model.model, posed);
  std::vector<LatticeRow> plain = model.rows(choice), other;
  const auto is_plain = [&](const LatticeRow& row) {
    const PosedRowRecord& record = tables.rows[tables.patches[row[0]].row_begin + row[1]];
    return rule == DistanceRule::kFromBone && record.bind_extension_head == 0 && record.bind_extension_tail == 0 &&
           record.extension_head == 0 && record.extension_tail == 0;
  };
  std::copy_if(plain.begin(), plain.end(), std::back_inserter(other),
               [&](const LatticeRow& row) { return !is_plain(row); });
  std::erase_if(plain, [&](const LatticeRow& row) { return !is_plain(row); });
  return {context.upload(tables.patches),
          context.upload(tables.rows),
          upload_columns(context, tables.columns),
          context.upload(plain),
          context.upload(other),
          rule == DistanceRule::kFromBone,
          tables.origin};
}

void displace_posed(ClContext& context, const DeviceLattice& lattice, const DevicePose& pose, DevicePlanes& points) {
  const DeviceTables& bind = lattice.tables;
  const auto parameters = [&](std::size_t row_count) {
    DisplaceParameters made = displace_parameters(row_count, lattice.texture_width, bind, lattice.texels, points);
    made.is_distance_kept = static_cast<int>(pose.is_distance_kept);
    return made;
  };
  if (pose.plain_rows.size > 0)
    context.launch({"pose.cl", "displace_posed"}, row_range(context, pose.plain_rows.size),
                   parameters(pose.plain_rows.size), pose.plain_rows, bind.rows, bind.columns, pose.patches,
                   pose.columns, lattice.texels.values, points.values);
  if (pose.other_rows.size > 0)
    context.launch({"pose.cl", "displace_posed_from_bind"}, row_range(context, pose.other_rows.size),
                   parameters(pose.other_rows.size), pose.other_rows, bind.rows, bind.columns, pose.patches, pose.rows,
                   pose.columns, lattice.texels.values, points.values);
}

void place_shared_vertices(const PreparedModel& prepared, const PosedPlanes& posed, DistanceRule rule,
                           std::vector<Vec3>& positions) {
  const SkeletexModel& model = prepared.model;
  const DisplacementTexture& texture = model.texture;
  for_each_pole(model, prepared.lattice, [&](VertexIndex vertex, BoneIndex bone, int end, std::size_t texel) {
    positions[vertex] = posed_point(model, prepared.separation, posed, bone, end, 0,
                                    Vec3(texture.along[texel], texture.around[texel], texture.out[texel]), rule);
  });
  for (int a = 0; a < static_cast<int>(model.arcs.size()); ++a)
    for (int i = 0; i < static_cast<int>(model.arcs[a].samples.size()); ++i)
      positions[prepared.lattice.first_sample[a] + i] = posed.sample_point(a, i, rule);
  for (int c = 0; c < static_cast<int>(model.corners.size()); ++c)
    positions[prepared.lattice.first_corner + c] = posed.corner_point(c, rule);
}

namespace {

void pose_smoothly(ClContext& context, const PreparedModel& model, const Skeleton& posed, DevicePlanes bind,
                   std::vector<Vec3>& positions) {
  const Skin skin = make_skin(context, model, bind);
  const DeviceSkin device = upload_skin(context, skin, std::move(bind));
  const std::vector<BoneMotion> motions = bone_motions(model.model.skeleton, posed);
  const Vec3 origin = middle_of_nodes(posed);
  DevicePlanes points = allocate_planes(context, model.lattice.inner_count);
  pose_skin(context, skin, device, motions, origin, points);
  download_points(context, points, origin, positions);
  pose_shared_vertices(skin, motions, positions);
}

void pose_linearly(ClContext& context, const PreparedModel& model, const Skeleton& posed, const DevicePlanes& bind,
                   std::vector<Vec3>& positions) {
  const VertexInfluences influences = strongest_influences(make_skin(context, model, bind));
  positions = skin_linearly(positions, influences, bone_motions(model.model.skeleton, posed));
}

void pose_by_own_coordinates(ClContext& context, const PreparedModel& model, const Skeleton& posed,
                             const DevicePlanes& bind, DistanceRule rule, std::vector<Vec3>& positions) {
  const PosedPlanes separation(model.model, posed);
  const DeviceCoordinates coordinates = make_coordinates(context, model, bind);
  const Vec3 origin = middle_of_nodes(posed);
  DevicePlanes points = allocate_planes(context, model.lattice.inner_count);
  pose_by_coordinates(context, model.model, coordinates, separation, rule, origin, points);
  download_points(context, points, origin, positions);
  place_shared_by_coordinates(model, separation, rule, positions);
}

/// The points of a lattice in a pose by the paper's rules, world.
std::vector<Vec3> paper_positions(ClContext& context, const PreparedModel& model, const PosedPlanes& posed,
                                  const DeviceLattice& lattice, RowChoice choice, DistanceRule rule) {
  const DevicePose pose = upload_pose(context, model, posed, choice, rule);
  DevicePlanes points = allocate_planes(context, lattice.vertex_count);
  displace_posed(context, lattice, pose, points);
  std::vector<Vec3> positions(lattice.vertex_count);
  download_points(context, points, pose.origin, positions);
  return positions;
}

void pose_by_paper(ClContext& context, const PreparedModel& model, const Skeleton& posed, DistanceRule rule,
                   std::vector<Vec3>& positions) {
  const PosedPlanes separation(model.model, posed);
  const std::vector<Vec3> inner = paper_positions(
      context, model, separation, upload_lattice(context, model, RowChoice::kInner), RowChoice::kInner, rule);
  std::copy(inner.begin(), inner.end(), positions.begin());
  place_shared_vertices(model, separation, rule, positions);
}

}  // namespace

const char* to_string(Deformation deformation) {
  switch (deformation) {
    case Deformation::kSmooth: return "smooth";
    case Deformation::kCoordinates: return "coordinates";
    case Deformation::kPaper: return "paper";
    case Deformation::kLinear: return "linear";
  }
  return "?";
}

TriangleMesh reconstruct_mesh(ClContext& context, const PreparedModel& model, const Skeleton& posed,
                              const PoseRule& rule) {
  auto [mesh, bind] = reconstruct_bind_mesh(context, model);
  switch (rule.deformation) {
    case Deformation::kSmooth: pose_smoothly(context, model, posed, std::move(bind), mesh.positions); break;
    case Deformation::kCoordinates:
      pose_by_own_coordinates(context, model, posed, bind, rule.distance, mesh.positions);
      break;
    case Deformation::kLinear: pose_linearly(context, model, posed, bind, mesh.positions); break;
    case Deformation::kPaper: pose_by_paper(context, model, posed, rule.distance, mesh.positions); break;
  }
  return in_user_units(std::move(mesh), posed.frame);
}

TriangleMesh constant_offset_mesh(ClContext& context, const PreparedModel& prepared, const Skeleton& posed,
                                  std::span<const int> bones, double offset, DistanceRule rule) {
  if (!(offset > 0))
    throw InputError(
        fmt::format("a plane in bone tangent space lies outside the bones: its offset, {}, must be above 0", offset));
  const SkeletexModel& model = prepared.model;
  DisplacementTexture plane = model.texture;
  std::fill(plane.along.begin(), plane.along.end(), 0.f);
  std::fill(plane.around.begin(), plane.around.end(), 0.f);
  std::fill(plane.out.begin(), plane.out.end(), static_cast<float>(offset));
  const std::vector<Vec3> positions = paper_positions(
      context, prepared, PosedPlanes(model, posed),
      upload_lattice(context, prepared.tables, model.patches, plane, RowChoice::kAll), RowChoice::kAll, rule);

  std::vector<int> firsts(model.patches.size() + 1, 0), all(model.patches.size());
  for (std::size_t i = 0; i < model.patches.size(); ++i)
    firsts[i + 1] = firsts[i] + model.patches[i].rectangle.width * model.patches[i].rectangle.height;
  std::iota(all.begin(), all.end(), 0);
  TriangleMesh mesh;
  for (const BoneIndex bone : bones.empty() ? std::span<const int>(all) : bones) {
    const auto [x, y, width, height] = model.patches[bone].rectangle;
    const int base = static_cast<int>(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), positions.begin() + firsts[bone], positions.begin() + firsts[bone + 1]);
    for (int row = 0; row + 1 < height; ++row)
      for (int j = 0; j < width; ++j) {
        const int v00 = base + row * width + j, v01 = base + row * width + (j + 1) % width, v10 = v00 + width,
                  v11 = v01 + width;
        mesh.triangles.push_back({v00, v01, v11});
        mesh.triangles.push_back({v00, v11, v10});
      }
  }
  return in_user_units(std::move(mesh), posed.frame);
}

}  // namespace skeletex
