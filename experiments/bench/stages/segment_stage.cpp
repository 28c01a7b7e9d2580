// SPDX-License-Identifier: MIT
#include "skeletex/convert/segment/segment_mesh.h"
#include "skeletex/geometry/half_edge.h"
#include "stages.h"

namespace skeletex {

Stage segment_stage(ClContext& context, MeshInputPointer input) {
  Stage stage;
  stage.name = "segment";
  stage.model = input->name;
  stage.size = static_cast<int>(input->mesh.triangles.size());
  stage.reference = "OpenMesh taking in the same faces, one pass";
  stage.run = [&context, input] { segment_mesh(context, input->mesh, input->skeleton); };
  stage.run_reference = [input] {
    return wall_ms([&] {
      HalfEdgeMesh mesh;
      for (const Vec3& p : input->mesh.positions) mesh.add_vertex(OpenMesh::Vec3d(p.x(), p.y(), p.z()));
      for (const auto& [a, b, c] : input->mesh.triangles)
        mesh.add_face(OpenMesh::VertexHandle(a), OpenMesh::VertexHandle(b), OpenMesh::VertexHandle(c));
    });
  };
  return stage;
}

}  // namespace skeletex
