// SPDX-License-Identifier: MIT
#include "skeletex/io/model_json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "skeletex/io/json_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

using nlohmann::json;

constexpr int kMaxInt = std::numeric_limits<int>::max();
constexpr std::array<const char*, 2> kEndNames{"head", "tail"};

int size_of(const auto& list) { return static_cast<int>(list.size()); }

json sample_to_json(const SeamSample& sample) { return {sample.turn, sample.distance}; }

std::string item(const std::string& where, const char* list, std::size_t i) {
  return fmt::format("{}: {}[{}]", where, list, i);
}

std::vector<double> numbers_from_json(const json& value, const std::string& where) {
  std::vector<double> numbers;
  numbers.reserve(json_array(value, where).size());
  for (const json& number : value) numbers.push_back(json_number(number, where));
  return numbers;
}

std::vector<int> indices_from_json(const json& value, int count, const std::string& where) {
  std::vector<int> indices;
  for (const json& index : json_array(value, where)) indices.push_back(json_int(index, 0, count - 1, where));
  return indices;
}

std::array<int, 2> pair_from_json(const json& value, int count, const std::string& where) {
  const std::vector<int> indices = indices_from_json(value, count, where);
  if (indices.size() != 2) throw IoError(where + ": two indices are expected");
  return {indices[0], indices[1]};
}

Method method_from_json(const json& value, const std::string& where) {
  for (const Method method : all_methods())
    if (value == to_string(method)) return method;
  throw IoError(fmt::format("{}: one of the methods {} is expected", where, fmt::join(method_names(), ", ")));
}

SegmentTopology topology_from_json(const json& value, const std::string& where) {
  for (const SegmentTopology topology : {SegmentTopology::kAnnulus, SegmentTopology::kDisk, SegmentTopology::kSphere})
    if (value == to_string(topology)) return topology;
  throw IoError(where + ": \"annulus\", \"disk\" or \"sphere\" is expected");
}

/// Letters, digits, - and _ are what every image program takes in the name of a layer.
std::string layer_word(const std::string& name) {
  std::string word = name.substr(0, 100);
  for (char& c : word)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
  return word;
}

json conventions() {
  return {
      {"texel",
       "R along, G around, B out: the vector from the bone's foot point W(u) towards the surface in the frame of (u, "
       "v), its length the surface "
       "point's distance from the bone as a segment"},
      {"frame",
       "out = f/|f| with f = s'(v) + k o; around = o x s'(v); along = out x around: left-handed in the order (along, "
       "around, out)"},
      {"angle",
       "v in turns about the bone from s towards b = o x s, o from head to tail; column j of a patch is v = j/width "
       "and wraps round"},
      {"rows", "row r of a patch is read at u = row_u[r], 0 at the head and 1 at the tail"},
      {"seams",
       "samples are turn, distance, turn, distance, ...: the angle about bones[0] and the distance to the half-line "
       "from the node along it"},
      {"origin",
       "of the image: first row of the file is y = 0, first column x = 0; triangles of the surface run "
       "counter-clockwise seen from outside"},
      {"weights",
       "where the header has \"weights\": per bone the channel of its weights in smooth poses, at least 0; their sum "
       "does not matter"},
      {"units", "lengths in the units of the input mesh, angles in turns"},
  };
}

}  // namespace

std::vector<std::string> weight_channels(const Skeleton& skeleton) {
  std::vector<std::string> names;
  for (const Bone& bone : skeleton.bones) {
    std::string name = "weights." + layer_word(bone.name);
    if (std::find(names.begin(), names.end(), name) != names.end()) name += fmt::format("_{}", names.size());
    names.push_back(std::move(name));
  }
  return names;
}

std::vector<std::string> weight_channels(const json& header, std::size_t bones, const std::string& where) {
  const auto found = header.find("weights");
  if (found == header.end()) return {};
  if (!found->is_array() || found->size() != bones)
    throw IoError(fmt::format("{}: \"weights\": the names of {} channels are expected, one per bone", where, bones));
  std::vector<std::string> names;
  for (const json& name : *found) {
    if (!name.is_string()) throw IoError(where + ": \"weights\": names of channels are expected");
    names.push_back(name.get<std::string>());
    if (std::count(names.begin(), names.end(), names.back()) > 1)
      throw IoError(fmt::format("{}: \"weights\": \"{}\" is named twice", where, names.back()));
  }
  return names;
}

json model_to_json(const SkeletexModel& model, const std::string& where) {
  json patches = json::array(), arcs = json::array(), corners = json::array();
  for (std::size_t i = 0; i < model.patches.size(); ++i) {
    const Patch& patch = model.patches[i];
    const Rectangle& r = patch.rectangle;
    json ends;
    for (const std::size_t end : {0u, 1u}) {
      json uses = json::array();
      for (const ArcUse& use : model.ends[i][end].arcs)
        uses.push_back({{"arc", use.arc}, {"reversed", use.is_reversed}});
      ends[kEndNames[end]] = std::move(uses);
    }
    patches.push_back({{"rectangle", {r.x, r.y, r.width, r.height}},
                       {"method", to_string(patch.method)},
                       {"topology", to_string(patch.topology)},
                       {"row_u", patch.row_u},
                       {"ends", std::move(ends)}});
  }
  for (const SeamArc& arc : model.arcs) {
    json samples = json::array();
    for (const SeamSample& sample : arc.samples) {
      samples.push_back(sample.turn);
      samples.push_back(sample.distance);
    }
    arcs.push_back({{"node", arc.node}, {"bones", arc.bones}, {"samples", std::move(samples)}});
    if (!arc.is_closed()) arcs.back()["corners"] = arc.corners;
  }
  for (const SeamCorner& corner : model.corners)
    corners.push_back({{"node", corner.node}, {"bones", corner.bones}, {"sample", sample_to_json(corner.sample)}});
  json result = {{"format", "skeletex"},
                 {"version", kModelFileVersion},
                 {"conventions", conventions()},
                 {"skeleton", skeleton_to_json(model.skeleton)},
                 {"origin", {model.origin[0], model.origin[1], model.origin[2]}},
                 {"diagonal", model.diagonal},
                 {"genus", model.genus},
                 {"texture", {{"width", model.texture.width}, {"height", model.texture.height}}},
                 {"patches", std::move(patches)},
                 {"arcs", std::move(arcs)},
                 {"corners", std::move(corners)}};
  if (model.diagonals == DiagonalRule::kSmooth) result["diagonals"] = "smooth";
  if (!model.bone_weights.empty()) result["weights"] = weight_channels(model.skeleton);
  if (!model.encoder_settings.empty()) {
    result["encoder"] = parse_json(model.encoder_settings, where + ": encoder settings");
    if (!result["encoder"].is_object()) throw IoError(where + ": the encoder's settings must be a JSON object");
  }
  return result;
}

SkeletexModel model_from_json(const json& root, const std::string& where) {
  const auto member = [&](const json& object, const char* key, const std::string& here) -> const json& {
    return json_member(object, key, here);
  };
  if (!root.is_object() || root.value("format", json()) != "skeletex")
    throw IoError(where + ": the header is not that of a skeletex model");
  const int version = json_int(member(root, "version", where), 1, kMaxInt, where + ": \"version\"");
  if (version > kModelFileVersion)
    throw IoError(fmt::format(
        "{}: written in version {} of the format, this program reads up to version {}; use a newer skeletex", where,
        version, kModelFileVersion));

  SkeletexModel model;
  model.skeleton = skeleton_from_json(member(root, "skeleton", where), where + ": skeleton");
  const int nodes = size_of(model.skeleton.nodes), bones = size_of(model.skeleton.bones);
  const std::vector<double> origin = numbers_from_json(member(root, "origin", where), where + ": \"origin\"");
  if (origin.size() != 3) throw IoError(where + ": \"origin\": three numbers are expected");
  model.origin = {origin[0], origin[1], origin[2]};
  model.diagonal = json_number(member(root, "diagonal", where), where + ": \"diagonal\"");
  model.genus = json_int(member(root, "genus", where), 0, kMaxInt, where + ": \"genus\"");
  if (root.contains("diagonals")) {
    const json& rule = root["diagonals"];
    if (rule != "smooth" && rule != "nearest")
      throw IoError(where + ": \"diagonals\": \"smooth\" or \"nearest\" is expected");
    model.diagonals = rule == "smooth" ? DiagonalRule::kSmooth : DiagonalRule::kNearest;
  }
  const json& texture = member(root, "texture", where);
  model.texture.width =
      json_int(member(texture, "width", where + ": texture"), 1, kMaxTextureSize, where + ": texture, \"width\"");
  model.texture.height =
      json_int(member(texture, "height", where + ": texture"), 1, kMaxTextureSize, where + ": texture, \"height\"");

  const json& corners = json_array(member(root, "corners", where), where + ": \"corners\"");
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const std::string here = item(where, "corners", i);
    SeamCorner corner;
    corner.node = json_int(member(corners[i], "node", here), 0, nodes - 1, here + ", \"node\"");
    corner.bones = indices_from_json(member(corners[i], "bones", here), bones, here + ", \"bones\"");
    const std::vector<double> sample = numbers_from_json(member(corners[i], "sample", here), here + ", \"sample\"");
    if (sample.size() != 2) throw IoError(here + ", \"sample\": [turn, distance] is expected");
    corner.sample = {sample[0], sample[1]};
    model.corners.push_back(std::move(corner));
  }
  const json& arcs = json_array(member(root, "arcs", where), where + ": \"arcs\"");
  for (std::size_t i = 0; i < arcs.size(); ++i) {
    const std::string here = item(where, "arcs", i);
    SeamArc arc;
    arc.node = json_int(member(arcs[i], "node", here), 0, nodes - 1, here + ", \"node\"");
    arc.bones = pair_from_json(member(arcs[i], "bones", here), bones, here + ", \"bones\"");
    if (arcs[i].contains("corners"))
      arc.corners = pair_from_json(arcs[i]["corners"], size_of(model.corners), here + ", \"corners\"");
    const std::vector<double> samples = numbers_from_json(member(arcs[i], "samples", here), here + ", \"samples\"");
    if (samples.size() % 2 != 0) throw IoError(here + ", \"samples\": pairs of turn and distance are expected");
    for (std::size_t s = 0; s < samples.size(); s += 2) arc.samples.push_back({samples[s], samples[s + 1]});
    model.arcs.push_back(std::move(arc));
  }
  const json& patches = json_array(member(root, "patches", where), where + ": \"patches\"");
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const std::string here = item(where, "patches", i);
    Patch patch;
    const json& r = json_array(member(patches[i], "rectangle", here), here + ", \"rectangle\"");
    if (r.size() != 4) throw IoError(here + ", \"rectangle\": [x, y, width, height] is expected");
    const auto part = [&](std::size_t k) { return json_int(r[k], 0, kMaxTextureSize, here + ", \"rectangle\""); };
    patch.rectangle = {part(0), part(1), part(2), part(3)};
    patch.method = method_from_json(member(patches[i], "method", here), here + ", \"method\"");
    patch.topology = topology_from_json(member(patches[i], "topology", here), here + ", \"topology\"");
    patch.row_u = numbers_from_json(member(patches[i], "row_u", here), here + ", \"row_u\"");
    model.patches.push_back(std::move(patch));
    std::array<PatchEnd, 2> ends;
    for (const std::size_t end : {0u, 1u}) {
      const std::string there = fmt::format("{}, ends.{}", here, kEndNames[end]);
      for (const json& use : json_array(member(member(patches[i], "ends", here), kEndNames[end], here), there)) {
        const json& is_reversed = member(use, "reversed", there);
        if (!is_reversed.is_boolean()) throw IoError(there + ", \"reversed\": true or false is expected");
        ends[end].arcs.push_back({json_int(member(use, "arc", there), 0, size_of(model.arcs) - 1, there + ", \"arc\""),
                                  is_reversed.get<bool>()});
      }
    }
    model.ends.push_back(std::move(ends));
  }
  if (const auto encoder = root.find("encoder"); encoder != root.end()) {
    if (!encoder->is_object()) throw IoError(where + ": \"encoder\": an object is expected");
    model.encoder_settings = encoder->dump();
  }
  check_model(model, where);
  return model;
}

namespace {

class ModelCheck {
 public:
  ModelCheck(const SkeletexModel& model, const std::string& where) : m_(model), where_(where) {}

  void run() {
    require(m_.diagonal >= kSmallestDiagonal && m_.diagonal <= kLargestDiagonal, "diagonal",
            fmt::format("must be a length from {:g} to {:g}, as single precision holds no others", kSmallestDiagonal,
                        kLargestDiagonal));
    require(m_.origin.allFinite() && m_.origin.cwiseAbs().maxCoeff() <= 1e12 * m_.diagonal, "origin",
            "must be finite, and within 1e12 diagonals of zero");
    require(m_.genus >= 0, "genus", "must not be negative");
    require(m_.texture.width > 0 && m_.texture.height > 0 && m_.texture.width <= kMaxTextureSize &&
                m_.texture.height <= kMaxTextureSize,
            "texture", fmt::format("its sides must be from 1 to {}", kMaxTextureSize));
    check_skeleton();
    require(m_.patches.size() == m_.skeleton.bones.size() && m_.ends.size() == m_.skeleton.bones.size(), "patches",
            "there must be one for each bone");
    check_patches();
    check_corners();
    check_arcs();
    check_ends();
  }

 private:
  void require(bool condition, const std::string& entry, const std::string& rule) const {
    if (!condition)
      throw IoError(fmt::format("{}: {}: {}; the file is damaged or was not written by skeletex", where_, entry, rule));
  }
  static std::string entry(const char* list, std::size_t i) { return fmt::format("{}[{}]", list, i); }

  int node_of(std::size_t bone, std::size_t end) const {
    return end == 0 ? m_.skeleton.bones[bone].head : m_.skeleton.bones[bone].tail;
  }
  bool is_at(int bone, int node) const {
    return m_.skeleton.bones[bone].head == node || m_.skeleton.bones[bone].tail == node;
  }
  bool is_index(int index, const auto& list) const { return index >= 0 && index < size_of(list); }
  bool is_sample(const SeamSample& s) const {
    return s.turn >= 0 && s.turn < 1 && s.distance >= 0 && s.distance <= kMostDiagonals * m_.diagonal;
  }

  void check_skeleton() {
    const auto& bones = m_.skeleton.bones;
    for (const Node& node : m_.skeleton.nodes)
      require(node.position.allFinite() &&
                  (node.position - m_.origin).cwiseAbs().maxCoeff() <= kMostDiagonals * m_.diagonal,
              "skeleton",
              fmt::format("node \"{}\" must lie within {:g} diagonals of the origin", node.name, kMostDiagonals));
    bones_at_.assign(m_.skeleton.nodes.size(), 0);
    require(!bones.empty(), "skeleton", "must have a bone");
    for (const Bone& bone : bones) {
      require(
          is_index(bone.head, m_.skeleton.nodes) && is_index(bone.tail, m_.skeleton.nodes) && bone.head != bone.tail,
          "skeleton", fmt::format("bone \"{}\" must join two nodes", bone.name));
      require(bone.s && bone.s->cwiseAbs().maxCoeff() >= 1e-6 && bone.s->cwiseAbs().maxCoeff() <= 1e6, "skeleton",
              fmt::format("bone \"{}\" must have its s, a direction of length about 1", bone.name));
      const double length = (m_.skeleton.nodes[bone.tail].position - m_.skeleton.nodes[bone.head].position).norm();
      require(length >= 1e-6 * m_.diagonal, "skeleton",
              fmt::format("bone \"{}\" must be at least a millionth of the diagonal long", bone.name));
      ++bones_at_[bone.head];
      ++bones_at_[bone.tail];
    }
    try {
      bone_bases(m_.skeleton);
      check_directions(m_.skeleton);
    } catch (const Error& error) {
      throw IoError(fmt::format("{}: skeleton: {}", where_, error.what()));
    }
  }

  void check_patches() const {
    std::vector<bool> is_taken(static_cast<std::size_t>(m_.texture.width) * static_cast<std::size_t>(m_.texture.height),
                               false);
    for (std::size_t i = 0; i < m_.patches.size(); ++i) {
      const Patch& patch = m_.patches[i];
      const Rectangle& r = patch.rectangle;
      require(r.x >= 0 && r.y >= 0 && r.width >= 3 && r.height >= 2 && r.width <= m_.texture.width &&
                  r.height <= m_.texture.height && r.x <= m_.texture.width - r.width &&
                  r.y <= m_.texture.height - r.height,
              entry("patches", i),
              fmt::format("its rectangle must be at least 3 x 2 and lie in the texture of {} x {}", m_.texture.width,
                          m_.texture.height));
      bool is_apart = true;
      for (int y = r.y; y < r.y + r.height; ++y) {
        const auto first = is_taken.begin() + y * static_cast<std::ptrdiff_t>(m_.texture.width) + r.x;
        is_apart = is_apart && std::find(first, first + r.width, true) == first + r.width;
        std::fill_n(first, r.width, true);
      }
      require(is_apart, entry("patches", i), "its rectangle must not overlap others");
      require(size_of(patch.row_u) == r.height, entry("patches", i), "row_u must have an entry per row");
      bool is_increasing = patch.row_u.front() == 0 && patch.row_u.back() == 1;
      for (std::size_t row = 1; row < patch.row_u.size(); ++row)
        is_increasing = is_increasing && patch.row_u[row - 1] < patch.row_u[row];
      require(is_increasing, entry("patches", i), "row_u must increase from 0 to 1");
      const int free_ends = (bones_at_[node_of(i, 0)] == 1) + (bones_at_[node_of(i, 1)] == 1);
      constexpr std::array kTopologies{SegmentTopology::kAnnulus, SegmentTopology::kDisk, SegmentTopology::kSphere};
      require(
          patch.topology == kTopologies[free_ends], entry("patches", i),
          fmt::format("a bone with {} free ends has the topology {}", free_ends, to_string(kTopologies[free_ends])));
    }
  }

  void check_corners() const {
    for (std::size_t i = 0; i < m_.corners.size(); ++i) {
      const SeamCorner& corner = m_.corners[i];
      require(is_index(corner.node, m_.skeleton.nodes), entry("corners", i), "its node must exist");
      std::vector<int> bones = corner.bones;
      std::sort(bones.begin(), bones.end());
      require(bones.size() >= 3 && std::adjacent_find(bones.begin(), bones.end()) == bones.end(), entry("corners", i),
              "three or more bones meet at a corner");
      for (const int bone : bones)
        require(is_index(bone, m_.skeleton.bones) && is_at(bone, corner.node), entry("corners", i),
                "its bones must lie at its node");
      require(is_sample(corner.sample), entry("corners", i),
              "turn must be in [0,1), distance not negative and at most 100 diagonals");
    }
  }

  void check_arcs() const {
    for (std::size_t i = 0; i < m_.arcs.size(); ++i) {
      const SeamArc& arc = m_.arcs[i];
      require(is_index(arc.node, m_.skeleton.nodes), entry("arcs", i), "its node must exist");
      require(arc.bones[0] != arc.bones[1], entry("arcs", i), "lies between two bones");
      for (const int bone : arc.bones)
        require(is_index(bone, m_.skeleton.bones) && is_at(bone, arc.node), entry("arcs", i),
                "its bones must lie at its node");
      require((arc.corners[0] < 0) == (arc.corners[1] < 0), entry("arcs", i), "has two corners or none");
      for (const int corner : arc.corners) {
        if (arc.is_closed()) continue;
        require(is_index(corner, m_.corners) && m_.corners[corner].node == arc.node, entry("arcs", i),
                "its corners must exist and lie at its node");
        for (const int bone : arc.bones) {
          const auto& bones = m_.corners[corner].bones;
          require(std::find(bones.begin(), bones.end(), bone) != bones.end(), entry("arcs", i),
                  "its bones must meet at its corners");
        }
      }
      require(arc.samples.size() >= (arc.is_closed() ? 3u : 1u), entry("arcs", i),
              "a closed arc has at least three samples, an open one at least one");
      require(std::all_of(arc.samples.begin(), arc.samples.end(), [&](const SeamSample& s) { return is_sample(s); }),
              entry("arcs", i), "turns must be in [0,1), distances not negative and at most 100 diagonals");
    }
  }

  void check_ends() const {
    std::vector<std::array<int, 2>> uses(m_.arcs.size(), {0, 0});
    for (std::size_t bone = 0; bone < m_.ends.size(); ++bone)
      for (const std::size_t end : {0u, 1u}) {
        const std::string here = fmt::format("patches[{}], ends.{}", bone, kEndNames[end]);
        const std::vector<ArcUse>& loop = m_.ends[bone][end].arcs;
        const int node = node_of(bone, end);
        require(loop.empty() == (bones_at_[node] == 1), here,
                "arcs run along an end that has neighbours, and none along a free one");
        for (std::size_t k = 0; k < loop.size(); ++k) {
          require(is_index(loop[k].arc, m_.arcs), here, "its arcs must exist");
          const SeamArc& arc = m_.arcs[loop[k].arc];
          require(
              arc.node == node && (arc.bones[0] == static_cast<int>(bone) || arc.bones[1] == static_cast<int>(bone)),
              here, "its arcs must be the bone's own");
          const std::size_t side = arc.bones[0] == static_cast<int>(bone) ? 0 : 1;
          ++uses[loop[k].arc][side];
          // Angles about two bones run against each other when both begin, or both end, at the node.
          const std::size_t other =
              static_cast<std::size_t>(m_.skeleton.bones[arc.bones[1 - side]].head == node ? 0 : 1);
          require(loop[k].is_reversed == (side == 1 && other == end), here,
                  "an arc runs with the angle about its first bone");
          if (arc.is_closed()) {
            require(loop.size() == 1, here, "a closed arc is a loop of its own");
            continue;
          }
          const ArcUse& after = loop[(k + 1) % loop.size()];
          require(is_index(after.arc, m_.arcs), here, "its arcs must exist");
          const int from = arc.corners[loop[k].is_reversed ? 0 : 1],
                    to = m_.arcs[after.arc].corners[after.is_reversed ? 1 : 0];
          require(from == to, here, "each arc must begin where the one before ends");
        }
      }
    for (std::size_t i = 0; i < uses.size(); ++i)
      require(uses[i][0] == 1 && uses[i][1] == 1, entry("arcs", i), "must be part of one end of each of its two bones");
  }

  const SkeletexModel& m_;
  const std::string& where_;
  std::vector<int> bones_at_;
};

}  // namespace

void check_model(const SkeletexModel& model, const std::string& where) { ModelCheck(model, where).run(); }

}  // namespace skeletex
