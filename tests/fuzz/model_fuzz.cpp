// SPDX-License-Identifier: MIT
// Models that a file could hold, through reconstruction, resampling, morph and transfer. Their structure is that of
// surfaces in closed form; the input changes their values.
#include <fuzzer/FuzzedDataProvider.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "fuzz.h"
#include "skeletex/convert/resample/resample.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/io/check_model.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/correspondence.h"
#include "support/mesh_topology.h"
#include "support/synthetic_model.h"

namespace {

using namespace skeletex;
using Data = FuzzedDataProvider;

constexpr std::array<Skeleton (*)(), 8> kSkeletons{lone_bone,
                                                   [] { return chain(2); },
                                                   [] { return chain(4); },
                                                   y_branch,
                                                   [] { return cross(5); },
                                                   [] { return ring(3); },
                                                   [] { return ring_with_arm(4); },
                                                   [] { return random_tree(7, 3); }};

/// Models of one skeleton differ in their rectangles.
const SkeletexModel& model_in_closed_form(int skeleton, unsigned sizes) {
  static std::map<std::pair<int, unsigned>, SkeletexModel> models;
  const auto [it, is_new] = models.try_emplace({skeleton, sizes});
  if (is_new) {
    const SyntheticSurface surface(kSkeletons[skeleton](), 0.2);
    const int bones = static_cast<int>(surface.skeleton().bones.size());
    it->second = surface.model(random_sizes(bones, 4, 10, sizes));
  }
  return it->second;
}

/// Numbers around 1 as models hold them, and now and then one at the edge of what is allowed.
double number(Data& data) {
  constexpr std::array kEdges{0.0, -0.0, 1.0, -1.0, 1e-300, 1e-30, 1e-7, 99.0, -99.0, 1e12};
  return data.ConsumeProbability<double>() < 0.25 ? data.PickValueInArray(kEdges)
                                                  : data.ConsumeFloatingPointInRange(-2.0, 2.0);
}

template <class List>
auto& any_of(Data& data, List& list) {
  return list[data.ConsumeIntegralInRange<std::size_t>(0, list.size() - 1)];
}

void change_seam(Data& data, SkeletexModel& model) {
  if (model.arcs.empty()) return;
  SeamArc& arc = any_of(data, model.arcs);
  const bool is_corner = data.ConsumeBool() && !model.corners.empty();
  SeamSample& sample = is_corner ? any_of(data, model.corners).sample : any_of(data, arc.samples);
  switch (data.ConsumeIntegralInRange(0, 3)) {
    case 0: sample.turn = data.ConsumeFloatingPointInRange(0.0, std::nextafter(1.0, 0.0)); break;
    case 1: sample.distance = std::abs(number(data)); break;
    case 2: arc.samples.push_back(any_of(data, arc.samples)); break;
    default: arc.samples.resize(data.ConsumeIntegralInRange<std::size_t>(1, arc.samples.size()));
  }
}

void change_patch(Data& data, SkeletexModel& model) {
  Patch& patch = any_of(data, model.patches);
  const int row = data.ConsumeIntegralInRange(0, patch.rectangle.height - 1);
  if (data.ConsumeBool() && row > 0 && row + 1 < patch.rectangle.height) {
    const double low = patch.row_u[row - 1], high = patch.row_u[row + 1];
    patch.row_u[row] = low + data.ConsumeProbability<double>() * (high - low);
  }
  patch.method = data.ConsumeBool() ? Method::kVsm : Method::kSpd;
  if (data.ConsumeBool()) patch.rectangle.width = data.ConsumeIntegralInRange(3, patch.rectangle.width);
}

void change_texels(Data& data, SkeletexModel& model) {
  DisplacementTexture& texture = model.texture;
  const double furthest = kMostDiagonals * model.diagonal;
  std::vector<float>& plane =
      *data.PickValueInArray({&texture.along, &texture.around, &texture.out});  // what a reader lets through
  const float value = static_cast<float>(std::clamp(number(data), -0.999 * furthest, 0.999 * furthest));
  const std::size_t first = data.ConsumeIntegralInRange<std::size_t>(0, plane.size() - 1);
  const std::size_t count = data.ConsumeIntegralInRange<std::size_t>(1, plane.size() - first);
  std::fill_n(plane.begin() + static_cast<std::ptrdiff_t>(first), count, value);
}

void change_whole(Data& data, SkeletexModel& model) {
  switch (data.ConsumeIntegralInRange(0, 4)) {
    case 0: model.origin = Vec3(number(data), number(data), number(data)); break;
    case 1: model.diagonals = data.ConsumeBool() ? DiagonalRule::kNearest : DiagonalRule::kSmooth; break;
    case 2: model.sampling = {data.ConsumeBool(), data.ConsumeBool(), data.ConsumeBool()}; break;
    case 3: model.bone_weights.assign(model.patches.size(), std::vector<float>(model.texture.out.size(), 0.5F)); break;
    default: model.layers = {{"heat", LayerKind::kNumber, {model.texture.out}}};
  }
}

SkeletexModel changed_model(Data& data, int skeleton) {
  SkeletexModel model = model_in_closed_form(skeleton, data.ConsumeIntegralInRange(0u, 2u));
  for (int changes = data.ConsumeIntegralInRange(0, 12); changes > 0; --changes)
    switch (data.ConsumeIntegralInRange(0, 5)) {
      case 0: any_of(data, model.skeleton.nodes).position = Vec3(number(data), number(data), number(data)); break;
      case 1: any_of(data, model.skeleton.bones).s = Vec3(number(data), number(data), number(data)); break;
      case 2: change_seam(data, model); break;
      case 3: change_patch(data, model); break;
      case 4: change_texels(data, model); break;
      default: change_whole(data, model);
    }
  check_model(model, "input");
  return model;
}

ClContext& device() {
  static ClContext context;
  return context;
}

/// Accepted models give closed surfaces of their genus.
void check_surface(const SkeletexModel& model) {
  const TriangleMesh mesh = reconstruct_mesh(device(), model);
  fuzz::require(broken_rule(mesh, model.genus).empty());
  for (const Vec3& position : mesh.positions) fuzz::require(position.allFinite());
}

void transfer_between(Data& data, const SkeletexModel& source, const SkeletexModel& target) {
  TransferOptions options;
  options.has_limbs = data.ConsumeBool();
  options.blend = data.PickValueInArray({TransferBlend::kCosine, TransferBlend::kLinear, TransferBlend::kNone});
  options.scale = data.PickValueInArray({TransferScale::kAuto, TransferScale::kLength, TransferScale::kGirth});
  options.is_smooth = data.ConsumeBool();
  if (data.ConsumeBool()) options.width = data.ConsumeProbability<double>();
  check_surface(transfer(device(), source, target,
                         {{any_of(data, source.skeleton.bones).name, any_of(data, target.skeleton.bones).name}},
                         options));
}

void morph_between(Data& data, const SkeletexModel& first, const SkeletexModel& second) {
  MorphOptions options;
  if (data.ConsumeBool()) options.size = data.ConsumeIntegralInRange(16, 32);
  options.is_smooth = data.ConsumeBool();
  const Morph morph(device(), {first, second}, std::vector{find_correspondence(first.skeleton, second.skeleton)},
                    options);
  const double share = data.ConsumeProbability<double>();
  check_surface(morph.at(std::vector{1 - share, share}));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  return fuzz::read_or_refuse([&] {
    Data data(bytes, size);
    const int step = data.ConsumeIntegralInRange(0, 3);
    const int skeleton = data.ConsumeIntegralInRange(0, static_cast<int>(kSkeletons.size()) - 1);
    const SkeletexModel first = changed_model(data, skeleton);
    if (step == 0) return check_surface(first);
    if (step == 1) return check_surface(resample_model(device(), first, data.ConsumeIntegralInRange(16, 32)));
    const SkeletexModel second = changed_model(data, skeleton);
    if (step == 2) return morph_between(data, first, second);
    transfer_between(data, first, second);
  });
}
