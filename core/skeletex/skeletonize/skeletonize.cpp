// SPDX-License-Identifier: MIT
#include "skeletex/skeletonize/skeletonize.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "skeletex/geometry/parallel.h"
#include "skeletex/math/portable.h"
#include "skeletex/model/error.h"
#include "skeletex/skeletonize/accept.h"
#include "skeletex/skeletonize/body/curve_graph.h"
#include "skeletex/skeletonize/body/fitting_body.h"
#include "skeletex/skeletonize/body/thinning.h"
#include "skeletex/skeletonize/body/tips.h"
#include "skeletex/skeletonize/body/voxel_body.h"
#include "skeletex/skeletonize/bones.h"
#include "skeletex/skeletonize/limbs.h"
#include "skeletex/skeletonize/names.h"
#include "skeletex/skeletonize/repair.h"

namespace skeletex {
namespace {

constexpr double kLimbReach = 0.1;  // a node so near to a tip reaches it; diagonals
/// Of the least error: more than so many times that is too much for a limb. Corners and rims look like limbs too.
constexpr double kLimbsMayCost = 3;
constexpr double kJointsMayCost = 1.25;  // times the error, of joints in long limbs
constexpr std::array<double, 4> kDetails{0, 1.0 / 3, 0.5, 2.0 / 3};
constexpr double kLimbDetail = kDetails[1];  // that of the limbs which a skeleton should reach
/// Where no skeleton of a body with handles works, its rings are tried with many short bones. The separation planes of
/// a ring meet inside its polygon; the more sides that has, the nearer they meet to the middle of the hole, outside the
/// body.
constexpr double kFineBend = 0.05 * kBend;
constexpr int kMostHandles = 50;  // a ring of three bones or more around each; more take minutes to fail
/// What to do about handles that no skeleton has rings for.
constexpr const char* kHandleRemedy =
    ". `encode --close` cuts them off; with --close-handles X, only those with a loop of at most X diagonals around "
    "them";
constexpr std::array<int, 2> kEvenRings{5, 10};  // bones
constexpr int kMostWorse = 2;                    // rings of fewer bones that are tried in a row without a gain
/// Beside an accepted skeleton with half of the limbs, repairs end after so many margins. That is about a second.
constexpr long kMostMargins = 150'000;

/// The rule of tips at a level of detail from 0 to 1.
TipRule rule_of(double detail) {
  constexpr std::array<TipRule, 4> kRules{
      {{3.0, 0.20, 2.0, 0.20}, {2.0, 0.12, 1.6, 0.10}, {1.7, 0.07, 1.4, 0.06}, {1.5, 0.035, 1.3, 0.03}}};
  const double at = std::clamp(detail, 0.0, 1.0) * (kRules.size() - 1);
  const std::size_t below = std::min<std::size_t>(static_cast<std::size_t>(at), kRules.size() - 2);
  const double t = at - static_cast<double>(below);
  const auto mix = [t](double a, double b) {
    return a > 0 && b > 0 ? portable::pow(a, 1 - t) * portable::pow(b, t) : a;
  };
  const TipRule &a = kRules[below], &b = kRules[below + 1];
  return {mix(a.longer_than_wide, b.longer_than_wide), mix(a.least_length, b.least_length),
          mix(a.covered_radii, b.covered_radii), mix(a.least_covered, b.least_covered)};
}

/// A single bone in the largest ball, along the body.
Skeleton single_bone(const VoxelBody& body) {
  const int deepest = deepest_voxel(body);
  const Vec3 centre = body.centres[deepest];
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Vec3& p : body.centres) moments += (p - centre) * (p - centre).transpose();
  Vec3 axis = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors().col(2);
  int largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  if (axis[largest] < 0) axis = -axis;
  const Vec3 half = 0.3 * body.radii[deepest] * axis;
  Skeleton skeleton;
  skeleton.nodes = {{"", centre - half}, {"", centre + half}};
  skeleton.bones = {{"", 0, 1, {}}};
  return skeleton;
}

/// A level of detail on its way to a skeleton.
struct Level {
  std::string name;
  std::vector<int> tips;
  std::unique_ptr<Repair> repair;
  Skeleton skeleton;  ///< the repaired one
  CurveGraph curves{};
};

CurveGraph curves_of(const Surface& surface, const VoxelBody& body, const std::vector<int>& tips, int genus) {
  CurveGraph graph = make_curve_graph(body, thin_body(body, tips));
  limit_cycles(surface, genus, graph);
  smooth_branches(surface, body.side, graph);
  merge_hubs(surface, graph);
  return graph;
}

/// Where the ways from all tips to the one root come together; the root itself where there are fewer than two.
int branch_of(const BodyPaths& paths, const std::vector<int>& tips) {
  const int root = paths.roots.front();
  if (tips.size() < 2) return root;
  std::vector<std::size_t> passed(paths.parents.size(), 0);
  for (const int tip : tips)
    for (int at = tip; at != root; at = paths.parents[at]) ++passed[at];
  int at = tips.front();
  while (at != root && passed[at] < tips.size()) at = paths.parents[at];
  return at;
}

/// The ways to where limbs begin: the deepest voxel, or the curves around the handles. Where the deepest voxel lies in
/// a limb itself, as in the abdomen of a spider, limbs begin where all others meet.
BodyPaths paths_of(const VoxelBody& body, double diagonal, int genus) {
  if (genus > 0) {
    const std::vector<char> is_left = thin_body(body, {});
    std::vector<int> roots;
    for (int v = 0; v < body.size(); ++v)
      if (is_left[v]) roots.push_back(v);
    return find_paths(body, std::move(roots));
  }
  const int deepest = deepest_voxel(body);
  BodyPaths paths = find_paths(body, {deepest});
  const int branch = branch_of(paths, find_tips(body, paths, rule_of(kLimbDetail), diagonal));
  const bool is_in_limb = (body.centres[branch] - body.centres[deepest]).norm() > body.radii[deepest];
  return is_in_limb ? find_paths(body, {branch}) : paths;
}

/// Tips of a level; the ends of the body where it has no limb and no handle.
std::vector<int> tips_of(const VoxelBody& body, const BodyPaths& paths, double detail, double diagonal, int genus) {
  std::vector<int> tips = find_tips(body, paths, rule_of(detail), diagonal);
  if (genus == 0 && tips.size() < 2) tips = find_ends(body);
  return tips;
}

/// Regular polygons around the one handle, whose curve is that of the first level.
void add_even_rings(const Surface& surface, const VoxelBody& body, std::vector<Level>& levels) {
  for (const int bones : kEvenRings) {
    const Skeleton ring = make_even_ring(surface, body, levels[0].curves, bones);
    if (ring.bones.empty()) continue;
    levels.push_back({fmt::format("even ring of {}", bones), {}, std::make_unique<Repair>(surface, ring), {}});
    levels.back().repair->run();
  }
}

std::vector<Level> make_levels(const Surface& surface, const VoxelBody& body, const BodyPaths& paths, int genus,
                               const SkeletonizeOptions& options) {
  std::vector<Level> levels;
  const auto add = [&](std::string name, std::vector<int> tips) {
    std::sort(tips.begin(), tips.end());
    if (std::none_of(levels.begin(), levels.end(), [&](const Level& level) { return level.tips == tips; }))
      levels.push_back({std::move(name), std::move(tips), nullptr, {}});
  };
  if (genus == 0)
    add("from end to end", find_ends(body));
  else
    add("handles", {});
  std::vector<double> details(kDetails.begin(), kDetails.end());
  if (options.detail) details = {*options.detail};
  for (const double detail : details)
    add(fmt::format("detail {:.2g}", detail), tips_of(body, paths, detail, surface.diagonal, genus));
  for_each_index(levels.size(), [&](std::size_t i) {
    levels[i].curves = curves_of(surface, body, levels[i].tips, genus);
    levels[i].repair = std::make_unique<Repair>(surface, make_bones(surface, body.side, levels[i].curves));
    levels[i].repair->run();
  });
  if (genus == 1) add_even_rings(surface, body, levels);
  if (genus == 0) {
    levels.push_back({"single bone", {}, nullptr, {}});
    levels.back().repair = std::make_unique<Repair>(surface, single_bone(body));
  }
  return levels;
}

/// Takes the symmetric skeleton next to one where the body has a mirror plane and that one is accepted as well.
void make_symmetric(const Surface& surface, const std::optional<MirrorPlane>& plane, const Acceptance& acceptance,
                    Skeleton& skeleton) {
  if (!plane) return;
  std::optional<Skeleton> image = symmetrized(surface, *plane, skeleton);
  if (!image) return;
  for (const BoneMargin& margin : bone_margins(surface.mesh, surface.tree, *image))
    if (margin.margin < 0) return;
  if (acceptance.is_accepted(*image)) skeleton = std::move(*image);
}

/// Rings of many short bones; nothing where they have no room.
/// \param handles  the level without limbs
std::optional<Level> make_fine_level(const Surface& surface, double voxel_side, const Level& handles, bool is_thinned) {
  Level level{is_thinned ? "fine handles" : "finest handles", {}, nullptr, {}};
  level.repair = std::make_unique<Repair>(surface, make_bones(surface, voxel_side, handles.curves, kFineBend));
  if (!level.repair->run()) return std::nullopt;
  if (is_thinned) level.repair->thin_out();
  return level;
}

/// Whether a candidate is accepted, and its limbs are worth its error.
/// \param least  error of the accepted candidates
bool is_fine(const SkeletonCandidate& candidate, double least) {
  return candidate.refusal.empty() && candidate.error <= kLimbsMayCost * least;
}

/// Of the accepted candidates.
double least_error(const std::vector<SkeletonCandidate>& candidates) {
  double least = std::numeric_limits<double>::infinity();
  for (const SkeletonCandidate& candidate : candidates)
    if (candidate.refusal.empty()) least = std::min(least, candidate.error);
  return least;
}

/// How many limbs a skeleton must reach to be chosen beside these candidates.
int least_limbs(const std::vector<SkeletonCandidate>& candidates, const SkeletonizeOptions& options) {
  if (options.purpose != SkeletonPurpose::kPose || options.most_bones) return 0;
  const double least = least_error(candidates);
  int most = 0;
  for (const SkeletonCandidate& candidate : candidates)
    if (is_fine(candidate, least)) most = std::max(most, candidate.limbs);
  return most;
}

/// Why the repair of a candidate is given up; empty: it is not.
/// \param limbs  that it has left
/// \param measured  margins in its repair
/// \param least  limbs that it needs
/// \param all  limbs of the body
std::string reason_to_stop(int limbs, long measured, int least, int all) {
  if (limbs < least) return "it has fewer limbs left than another skeleton";
  if (measured > kMostMargins && least > 0 && 2 * least >= all)
    return "its repair takes too long beside another skeleton";
  return {};
}

/// Which of the accepted candidates is best; -1: none.
int choose(const std::vector<SkeletonCandidate>& candidates, const SkeletonizeOptions& options) {
  const double least = least_error(candidates);
  const auto rank = [&](const SkeletonCandidate& candidate) {
    const int first = options.most_bones                                                       ? candidate.bones
                      : options.purpose == SkeletonPurpose::kPose && is_fine(candidate, least) ? candidate.limbs + 1
                                                                                               : 0;
    return std::make_pair(-first, candidate.error);
  };
  int best = -1;
  for (int c = 0; c < static_cast<int>(candidates.size()); ++c)
    if (candidates[c].refusal.empty() && (best < 0 || rank(candidates[c]) < rank(candidates[best]))) best = c;
  return best;
}

/// Tries the chosen rings with ever fewer bones, which can give a smaller error, and chooses again.
void try_shorter_rings(std::vector<Level>& levels, SkeletonizeResult& result, const SkeletonizeOptions& options,
                       const std::function<void(Level&)>& try_level) {
  auto repair = std::make_unique<Repair>(*levels[result.chosen].repair);
  const auto shorten = [&] {
    const std::size_t before = repair->skeleton().bones.size(), wanted = before - std::max<std::size_t>(1, before / 6);
    while (repair->skeleton().bones.size() > wanted && repair->contract_cheapest()) {
    }
    return repair->skeleton().bones.size() < before;
  };
  for (int worse = 0; worse < kMostWorse && shorten(); ++worse) {
    levels.push_back({fmt::format("handles, {} bones", repair->skeleton().bones.size()), {}, std::move(repair), {}});
    try_level(levels.back());
    if (!result.candidates.back().refusal.empty()) break;
    repair = std::make_unique<Repair>(*levels.back().repair);
    const int best = choose(result.candidates, options);
    if (best != result.chosen) worse = -1;
    result.chosen = best;
  }
}

/// Tries joints in the long limbs of the chosen skeleton, then of others with as many limbs, which must be better.
void try_joints(const Surface& surface, std::vector<Level>& levels, SkeletonizeResult& result,
                const std::function<void(Level&)>& try_level) {
  const SkeletonCandidate chosen = result.candidates[result.chosen];
  const auto try_with_joints = [&](std::size_t l, double most_error) {
    const std::size_t bones = levels[l].skeleton.bones.size();
    Skeleton jointed = with_joints(surface, levels[l].skeleton);
    if (jointed.bones.size() == bones) return;
    levels.push_back({levels[l].name + ", joints", {}, std::make_unique<Repair>(surface, std::move(jointed)), {}});
    try_level(levels.back());
    const SkeletonCandidate& after = result.candidates.back();
    if (after.refusal.empty() && after.bones > static_cast<int>(bones) && after.error <= most_error)
      result.chosen = static_cast<int>(result.candidates.size()) - 1;
  };
  const std::size_t first = result.chosen, count = levels.size();
  try_with_joints(first, kJointsMayCost * chosen.error);
  for (std::size_t l = 0; l < count; ++l) {
    const SkeletonCandidate& before = result.candidates[l];
    if (l != first && before.refusal.empty() && before.limbs == chosen.limbs &&
        before.error <= kJointsMayCost * chosen.error)
      try_with_joints(l, result.candidates[result.chosen].error);
  }
}

/// Tries rings of many short bones where no skeleton of a body with handles works.
void try_fine_rings(const Surface& surface, double voxel_side, std::vector<Level>& levels, SkeletonizeResult& result,
                    const std::function<void(Level&)>& try_level) {
  for (const bool is_thinned : {true, false}) {
    std::optional<Level> level = make_fine_level(surface, voxel_side, levels[0], is_thinned);
    if (!level) return;
    levels.push_back(std::move(*level));
    try_level(levels.back());
    if (result.candidates.back().refusal.empty()) return;
  }
}

/// Why none of the candidates is taken.
std::string refusal_of(const SkeletonizeResult& result) {
  const SkeletonCandidate& first = result.candidates.front();
  return fmt::format("none of {} skeletons works; for \"{}\": {}{}", result.candidates.size(), first.name,
                     first.refusal, result.genus > 0 ? kHandleRemedy : "");
}

}  // namespace

SkeletonizeResult skeletonize(ClContext& context, const TriangleMesh& mesh, const TriangleTree& tree,
                              const SkeletonizeOptions& options) {
  const auto report = [&](const std::string& stage, double done) {
    if (options.progress && !options.progress(stage, done)) throw Error("cancelled");
  };
  const UnitMesh unit(mesh, tree);
  Surface surface(unit.mesh, unit.tree);
  surface.frame = unit.frame;
  SkeletonizeResult result;
  result.genus = genus_of(mesh);
  if (result.genus > kMostHandles)
    throw TopologyError(fmt::format("the mesh has {} handles, and skeletons are found for up to {}{}", result.genus,
                                    kMostHandles, kHandleRemedy));
  report("filling the body", 0);
  const VoxelBody body = make_fitting_body(surface, result.genus);
  if (body.size() == 0)
    throw TopologyError(
        "the body is too thin for a skeleton: no point was found that is well inside; give the mesh some thickness");
  report("finding limbs", 0.15);
  const BodyPaths paths = paths_of(body, surface.diagonal, result.genus);
  const std::vector<int> tips = find_tips(body, paths, rule_of(kLimbDetail), surface.diagonal);
  const std::vector<LimbTip> limbs = places_near(body, tips, kLimbReach * surface.diagonal);
  result.limbs = static_cast<int>(tips.size());
  std::vector<Level> levels = make_levels(surface, body, paths, result.genus, options);
  const Acceptance acceptance(context, surface);
  const std::optional<MirrorPlane> plane = find_mirror_plane(surface, body);
  const auto try_level = [&](Level& level) {
    Repair& repair = *level.repair;
    while (options.most_bones && static_cast<int>(repair.skeleton().bones.size()) > std::max(1, *options.most_bones) &&
           repair.contract_cheapest()) {
    }
    const auto stop = [&, least = least_limbs(result.candidates, options)](const Repair& tried) {
      return reason_to_stop(count_reached(limbs, tried.skeleton()), tried.measured(), least, result.limbs);
    };
    SkeletonCandidate candidate{level.name, 0, 0, 0, acceptance.segment(repair, stop)};
    level.skeleton = repair.skeleton();
    if (candidate.refusal.empty()) make_symmetric(surface, plane, acceptance, level.skeleton);
    candidate.bones = static_cast<int>(level.skeleton.bones.size());
    candidate.limbs = count_reached(limbs, level.skeleton);
    if (candidate.refusal.empty()) {
      const Acceptance::Trial trial = acceptance.encode(level.skeleton);
      candidate.error = trial.error;
      candidate.refusal = trial.refusal;
    }
    result.candidates.push_back(std::move(candidate));
  };
  for (std::size_t l = 0; l < levels.size(); ++l) {
    report("trying skeletons", 0.4 + 0.6 * static_cast<double>(l) / static_cast<double>(levels.size()));
    try_level(levels[l]);
  }
  if (result.genus > 0 && choose(result.candidates, options) < 0) {
    report("trying finer rings", 0.95);
    try_fine_rings(surface, body.side, levels, result, try_level);
  }
  result.chosen = choose(result.candidates, options);
  if (result.chosen == 0 && result.genus > 0 && !options.most_bones) {
    report("trying rings of fewer bones", 0.97);
    try_shorter_rings(levels, result, options, try_level);
  }
  if (result.chosen < 0) throw TopologyError(refusal_of(result));
  if (options.purpose == SkeletonPurpose::kPose && !options.most_bones) try_joints(surface, levels, result, try_level);
  result.skeleton = std::move(levels[result.chosen].skeleton);
  name_by_place(surface, plane, result.skeleton);
  result.skeleton = in_frame(std::move(result.skeleton), {});
  report("done", 1);
  return result;
}

}  // namespace skeletex
