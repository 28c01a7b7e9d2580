// SPDX-License-Identifier: MIT
#pragma once
#include <OpenMesh/Core/IO/importer/BaseImporter.hh>
#include <string>

#include "skeletex/io/mesh_file.h"

namespace skeletex {

/// Takes what OpenMesh's readers deliver as it comes. OpenMesh's own importers build the half-edge mesh on the way and
/// leave out every face that does not fit; here faces are kept, so that validation can say what is wrong with them.
class MeshImporter : public OpenMesh::IO::BaseImporter {
 public:
  OpenMesh::VertexHandle add_vertex(const OpenMesh::Vec3f& point) override {
    return add(Vec3(point[0], point[1], point[2]));
  }
  OpenMesh::VertexHandle add_vertex(const OpenMesh::Vec3d& point) override {
    return add(Vec3(point[0], point[1], point[2]));
  }
  OpenMesh::VertexHandle add_vertex() override { return add(Vec3::Zero()); }
  void set_point(OpenMesh::VertexHandle vertex, const OpenMesh::Vec3f& point) override {
    mesh_.positions.at(static_cast<std::size_t>(vertex.idx())) = Vec3(point[0], point[1], point[2]);
  }
  OpenMesh::FaceHandle add_face(const VHandles& corners) override;
  void set_coordinate(std::size_t vertex, int axis, double value) { mesh_.positions.at(vertex)[axis] = value; }

  /// \throw IoError when a face names a vertex that does not exist, or one vertex twice with others between
  MeshFile take(const std::string& where);

  std::size_t n_vertices() const override { return mesh_.positions.size(); }
  std::size_t n_faces() const override { return corner_counts_.size(); }
  std::size_t n_edges() const override { return 0; }

  // Everything below is data that the project does not read from meshes.
  OpenMesh::HalfedgeHandle add_edge(OpenMesh::VertexHandle, OpenMesh::VertexHandle) override {
    return OpenMesh::HalfedgeHandle();
  }
  OpenMesh::FaceHandle add_face(OpenMesh::HalfedgeHandle) override { return OpenMesh::FaceHandle(); }
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle, const std::vector<OpenMesh::Vec2f>&) override {}
  void add_face_texcoords(OpenMesh::FaceHandle, OpenMesh::VertexHandle, const std::vector<OpenMesh::Vec3f>&) override {}
  void set_face_texindex(OpenMesh::FaceHandle, int) override {}
  void set_halfedge(OpenMesh::VertexHandle, OpenMesh::HalfedgeHandle) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::VertexHandle, const OpenMesh::Vec3d&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_normal(OpenMesh::FaceHandle, const OpenMesh::Vec3d&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::VertexHandle, const OpenMesh::Vec4f&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::EdgeHandle, const OpenMesh::Vec4f&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4uc&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec3f&) override {}
  void set_color(OpenMesh::FaceHandle, const OpenMesh::Vec4f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(OpenMesh::VertexHandle, const OpenMesh::Vec3f&) override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec2f&) override {}
  void set_texcoord(OpenMesh::HalfedgeHandle, const OpenMesh::Vec3f&) override {}
  void set_status(OpenMesh::VertexHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(OpenMesh::HalfedgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(OpenMesh::EdgeHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_status(OpenMesh::FaceHandle, const OpenMesh::Attributes::StatusInfo&) override {}
  void set_next(OpenMesh::HalfedgeHandle, OpenMesh::HalfedgeHandle) override {}
  void set_face(OpenMesh::HalfedgeHandle, OpenMesh::FaceHandle) override {}
  void request_face_texcoords2D() override {}
  void add_texture_information(int, std::string) override {}

 private:
  OpenMesh::VertexHandle add(const Vec3& position) {
    mesh_.positions.push_back(position);
    return OpenMesh::VertexHandle(static_cast<int>(mesh_.positions.size()) - 1);
  }
  TriangleMesh mesh_;
  std::vector<int> corners_;        ///< of all faces, one after the other
  std::vector<int> corner_counts_;  ///< per face
};

}  // namespace skeletex
