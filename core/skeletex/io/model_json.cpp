// SPDX-License-Identifier: MIT
#include "skeletex/io/model_json.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "skeletex/io/check_model.h"
#include "skeletex/io/json_file.h"
#include "skeletex/io/skeleton_file.h"
#include "skeletex/model/error.h"

namespace skeletex {
namespace {

using nlohmann::json;

constexpr int kMaxInt = std::numeric_limits<int>::max();
constexpr std::array<const char*, 2> kEndNames{"head", "tail"};

/// A value of the header, and its place for messages.
class Entry {
 public:
  /// \param where  of a header, the file; of what is in it, the file and the names on the way to it
  Entry(const json& value, std::string where, bool is_header = false)
      : value_(value), where_(std::move(where)), separator_(is_header ? ": " : ", ") {}

  const json& value() const { return value_; }
  bool has(const char* key) const { return value_.is_object() && value_.contains(key); }
  Entry member(const char* key) const {
    return {json_member(value_, key, where_), fmt::format("{}{}\"{}\"", where_, separator_, key)};
  }
  /// The entries of a list that is a member.
  std::vector<Entry> items(const char* key) const {
    std::vector<Entry> entries;
    for (const json& item : json_array(member(key).value_, member(key).where_))
      entries.push_back({item, fmt::format("{}{}{}[{}]", where_, separator_, key, entries.size())});
    return entries;
  }
  [[noreturn]] void fail(const char* expected) const { throw IoError(fmt::format("{}: {}", where_, expected)); }

  double number() const { return json_number(value_, where_); }
  int integer(int lower, int upper) const { return json_int(value_, lower, upper, where_); }
  int index_into(std::size_t count) const { return integer(0, static_cast<int>(count) - 1); }
  bool boolean() const {
    if (!value_.is_boolean()) fail("true or false is expected");
    return value_.get<bool>();
  }
  std::vector<double> numbers() const {
    std::vector<double> numbers;
    numbers.reserve(json_array(value_, where_).size());
    for (const json& number : value_) numbers.push_back(json_number(number, where_));
    return numbers;
  }
  std::vector<int> indices_into(std::size_t count) const {
    std::vector<int> indices;
    for (const json& index : json_array(value_, where_))
      indices.push_back(json_int(index, 0, static_cast<int>(count) - 1, where_));
    return indices;
  }
  std::array<int, 2> pair_into(std::size_t count) const {
    const std::vector<int> indices = indices_into(count);
    if (indices.size() != 2) fail("two indices are expected");
    return {indices[0], indices[1]};
  }

 private:
  const json& value_;
  std::string where_;
  const char* separator_;
};

Method method_from(const Entry& entry) {
  for (const Method method : all_methods())
    if (entry.value() == to_string(method)) return method;
  entry.fail(fmt::format("one of the methods {} is expected", fmt::join(method_names(), ", ")).c_str());
}

SegmentTopology topology_from(const Entry& entry) {
  for (const SegmentTopology topology : {SegmentTopology::kAnnulus, SegmentTopology::kDisk, SegmentTopology::kSphere})
    if (entry.value() == to_string(topology)) return topology;
  entry.fail("\"annulus\", \"disk\" or \"sphere\" is expected");
}

DiagonalRule diagonals_from(const Entry& header) {
  if (!header.has("diagonals")) return DiagonalRule::kNearest;
  const Entry rule = header.member("diagonals");
  if (rule.value() != "smooth" && rule.value() != "nearest") rule.fail("\"smooth\" or \"nearest\" is expected");
  return rule.value() == "smooth" ? DiagonalRule::kSmooth : DiagonalRule::kNearest;
}

/// Files before "sampling" tell it in the encoder's record, where only `true` counts.
TexelSampling sampling_from(const Entry& header) {
  if (header.has("sampling")) {
    const Entry sampling = header.member("sampling");
    return {sampling.member("prefiltered").boolean(), sampling.member("snapped").boolean(),
            sampling.member("fitted").boolean()};
  }
  const auto is_true = [&](const char* key) {
    return header.has("encoder") && header.member("encoder").has(key) &&
           header.member("encoder").member(key).value() == true;
  };
  return {is_true("prefilter"), is_true("snap"), is_true("fit")};
}

Vec3 vector_from(const Entry& entry) {
  const std::vector<double> values = entry.numbers();
  if (values.size() != 3) entry.fail("three numbers are expected");
  return {values[0], values[1], values[2]};
}

std::optional<Stance> stance_from(const Entry& header) {
  if (!header.has("stance")) return std::nullopt;
  const auto direction = [&](const char* key) {
    const Entry entry = header.member("stance").member(key);
    Vec3 vector = vector_from(entry);
    if (!(std::abs(vector.norm() - 1) < 1e-6)) entry.fail("a direction of length 1 is expected");
    return vector;
  };
  const Stance stance{direction("up"), direction("front")};
  if (std::abs(stance.up.dot(stance.front)) > 1e-6) header.member("stance").fail("up and front must be orthogonal");
  return stance;
}

/// Models of version 1 are in the user's units.
UnitFrame frame_from(const Entry& header) {
  if (!header.has("frame")) return {};
  const Entry frame = header.member("frame");
  return {vector_from(frame.member("offset")), frame.member("scale").number()};
}

SeamCorner corner_from(const Entry& entry, const Skeleton& skeleton) {
  SeamCorner corner;
  corner.node = entry.member("node").index_into(skeleton.nodes.size());
  const std::vector<int> bones = entry.member("bones").indices_into(skeleton.bones.size());
  corner.bones.assign(bones.begin(), bones.end());
  const std::vector<double> sample = entry.member("sample").numbers();
  if (sample.size() != 2) entry.member("sample").fail("[turn, distance] is expected");
  corner.sample = {sample[0], sample[1]};
  return corner;
}

SeamArc arc_from(const Entry& entry, const SkeletexModel& model) {
  SeamArc arc;
  arc.node = entry.member("node").index_into(model.skeleton.nodes.size());
  const std::array<int, 2> bones = entry.member("bones").pair_into(model.skeleton.bones.size());
  arc.bones = {bones[0], bones[1]};
  if (entry.has("corners")) arc.corners = entry.member("corners").pair_into(model.corners.size());
  const std::vector<double> samples = entry.member("samples").numbers();
  if (samples.size() % 2 != 0) entry.member("samples").fail("pairs of turn and distance are expected");
  for (std::size_t i = 0; i < samples.size(); i += 2) arc.samples.push_back({samples[i], samples[i + 1]});
  return arc;
}

Patch patch_from(const Entry& entry) {
  const Entry rectangle = entry.member("rectangle");
  const std::vector<int> sides = rectangle.indices_into(kMaxTextureSize + 1);
  if (sides.size() != 4) rectangle.fail("[x, y, width, height] is expected");
  return {{sides[0], sides[1], sides[2], sides[3]},
          method_from(entry.member("method")),
          topology_from(entry.member("topology")),
          entry.member("row_u").numbers()};
}

PatchEnd patch_end_from(const Entry& ends, const char* end, std::size_t arcs) {
  PatchEnd result;
  for (const Entry& use : ends.items(end))
    result.arcs.push_back({use.member("arc").index_into(arcs), use.member("reversed").boolean()});
  return result;
}

/// Letters, digits, - and _ are what every image program takes in the name of a layer.
std::string layer_word(const std::string& name) {
  std::string word = name.substr(0, 100);
  for (char& c : word)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
  return word;
}

constexpr std::array<LayerKind, 3> kLayerKinds{LayerKind::kNormal, LayerKind::kColour, LayerKind::kNumber};
const char* to_string(LayerKind kind) {
  switch (kind) {
    case LayerKind::kNormal: return "normal";
    case LayerKind::kColour: return "colour";
    case LayerKind::kNumber: return "number";
  }
  return "";
}
bool has_planes_of(LayerKind kind, std::size_t planes) {
  switch (kind) {
    case LayerKind::kNormal: return planes == 2;
    case LayerKind::kColour: return planes == 3 || planes == 4;
    case LayerKind::kNumber: return planes == 1;
  }
  return false;
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
      {"layers",
       "where the header has \"layers\": quantities of the surface at the texels' places, in channels of their own. "
       "Kind "
       "\"normal\": the unit normal (a, c, n) along, around and out as p = (a, c) / (|a| + |c| + |n|), and where n < 0 "
       "as ((1 - |p2|) sign(p1), (1 - |p1|) sign(p2)); \"colour\": linear light; \"number\": any number"},
      {"units",
       "lengths and places in the unit frame, in which the input has a diagonal of 1: in the user's units a place p is "
       "frame.offset + frame.scale p; angles in turns"},
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

std::vector<std::vector<std::string>> layer_channels(const std::vector<Layer>& layers) {
  constexpr std::array kParts{"R", "G", "B", "A"};
  std::vector<std::string> words;
  std::vector<std::vector<std::string>> channels;
  for (const Layer& layer : layers) {
    std::string word = layer_word(layer.name);
    if (word == "weights" || std::find(words.begin(), words.end(), word) != words.end())
      word += fmt::format("_{}", words.size());
    words.push_back(word);
    std::vector<std::string>& names = channels.emplace_back();
    for (std::size_t i = 0; i < layer.planes.size(); ++i)
      names.push_back(fmt::format("{}.{}", word, layer.kind == LayerKind::kNumber ? "Y" : kParts.at(i)));
  }
  return channels;
}

NamedLayers layers_from_json(const json& root, const std::string& where) {
  NamedLayers named;
  const Entry header(root, where, true);
  if (!header.has("layers")) return named;
  std::vector<std::string> all;
  for (const Entry& entry : header.items("layers")) {
    Layer layer;
    const Entry name = entry.member("name"), kind = entry.member("kind");
    if (!name.value().is_string() || name.value().get<std::string>().empty()) name.fail("a name is expected");
    layer.name = name.value().get<std::string>();
    const auto known = std::find_if(kLayerKinds.begin(), kLayerKinds.end(),
                                    [&](LayerKind of) { return kind.value() == to_string(of); });
    if (known == kLayerKinds.end()) continue;  // of a newer program; all else can be used without it
    layer.kind = *known;
    const Entry channels = entry.member("channels");
    std::vector<std::string> names;
    for (const Entry& channel : entry.items("channels")) {
      if (!channel.value().is_string()) channel.fail("the name of a channel is expected");
      names.push_back(channel.value().get<std::string>());
      if (std::find(all.begin(), all.end(), names.back()) != all.end()) channel.fail("the channel is named twice");
      all.push_back(names.back());
    }
    if (!has_planes_of(layer.kind, names.size())) channels.fail("a layer of this kind has another number of channels");
    if (std::any_of(named.layers.begin(), named.layers.end(), [&](const Layer& l) { return l.name == layer.name; }))
      name.fail("the layer is named twice");
    if (layer.kind != LayerKind::kNumber &&
        std::any_of(named.layers.begin(), named.layers.end(), [&](const Layer& l) { return l.kind == layer.kind; }))
      kind.fail("a model has one layer of this kind");
    layer.planes.resize(names.size());
    named.layers.push_back(std::move(layer));
    named.channels.push_back(std::move(names));
  }
  return named;
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
    corners.push_back(
        {{"node", corner.node}, {"bones", corner.bones}, {"sample", {corner.sample.turn, corner.sample.distance}}});
  const UnitFrame& frame = model.skeleton.frame;
  json result = {{"format", "skeletex"},
                 {"version", kModelFileVersion},
                 {"conventions", conventions()},
                 {"skeleton", skeleton_to_json(model.skeleton)},
                 {"frame", {{"offset", {frame.offset[0], frame.offset[1], frame.offset[2]}}, {"scale", frame.scale}}},
                 {"origin", {model.origin[0], model.origin[1], model.origin[2]}},
                 {"diagonal", model.diagonal},
                 {"genus", model.genus},
                 {"texture", {{"width", model.texture.width}, {"height", model.texture.height}}},
                 {"patches", std::move(patches)},
                 {"arcs", std::move(arcs)},
                 {"corners", std::move(corners)}};
  result["sampling"] = {{"prefiltered", model.sampling.is_prefiltered},
                        {"snapped", model.sampling.is_snapped},
                        {"fitted", model.sampling.is_fitted}};
  if (model.diagonals == DiagonalRule::kSmooth) result["diagonals"] = "smooth";
  if (!model.bone_weights.empty()) result["weights"] = weight_channels(model.skeleton);
  const std::vector<std::vector<std::string>> channels = layer_channels(model.layers);
  for (std::size_t i = 0; i < model.layers.size(); ++i) {
    const Layer& layer = model.layers[i];
    const auto is_double = [&](const Layer& other) {
      return &other != &layer &&
             (other.name == layer.name || (layer.kind != LayerKind::kNumber && other.kind == layer.kind));
    };
    if (layer.name.empty() || !has_planes_of(layer.kind, layer.planes.size()) ||
        std::any_of(model.layers.begin(), model.layers.end(), is_double))
      throw IoError(
          fmt::format("{}: layer \"{}\" of kind {} has {} planes, or the name of another one; normals and "
                      "colours have one layer each",
                      where, layer.name, to_string(layer.kind), layer.planes.size()));
    result["layers"].push_back({{"name", layer.name}, {"kind", to_string(layer.kind)}, {"channels", channels[i]}});
  }
  if (model.stance) {
    const auto list = [](const Vec3& v) { return json{v.x(), v.y(), v.z()}; };
    result["stance"] = {{"up", list(model.stance->up)}, {"front", list(model.stance->front)}};
  }
  if (!model.encoder_settings.empty()) {
    result["encoder"] = parse_json(model.encoder_settings, where + ": encoder settings");
    if (!result["encoder"].is_object()) throw IoError(where + ": the encoder's settings must be a JSON object");
  }
  return result;
}

SkeletexModel model_from_json(const json& root, const std::string& where) {
  if (!root.is_object() || root.value("format", json()) != "skeletex")
    throw IoError(where + ": the header is not that of a skeletex model");
  const Entry header(root, where, true);
  const int version = header.member("version").integer(1, kMaxInt);
  if (version > kModelFileVersion)
    throw IoError(fmt::format(
        "{}: written in version {} of the format, this program reads up to version {}; use a newer skeletex", where,
        version, kModelFileVersion));

  SkeletexModel model;
  model.skeleton = skeleton_from_json(header.member("skeleton").value(), where + ": skeleton");
  model.skeleton.frame = frame_from(header);
  model.origin = vector_from(header.member("origin"));
  model.diagonal = header.member("diagonal").number();
  model.genus = header.member("genus").integer(0, kMaxInt);
  model.diagonals = diagonals_from(header);
  model.sampling = sampling_from(header);
  model.stance = stance_from(header);
  model.texture.width = header.member("texture").member("width").integer(1, kMaxTextureSize);
  model.texture.height = header.member("texture").member("height").integer(1, kMaxTextureSize);
  for (const Entry& corner : header.items("corners")) model.corners.push_back(corner_from(corner, model.skeleton));
  for (const Entry& arc : header.items("arcs")) model.arcs.push_back(arc_from(arc, model));
  for (const Entry& patch : header.items("patches")) {
    model.patches.push_back(patch_from(patch));
    const Entry ends = patch.member("ends");
    model.ends.push_back(
        {patch_end_from(ends, kEndNames[0], model.arcs.size()), patch_end_from(ends, kEndNames[1], model.arcs.size())});
  }
  if (header.has("encoder")) {
    const Entry encoder = header.member("encoder");
    if (!encoder.value().is_object()) encoder.fail("an object is expected");
    model.encoder_settings = encoder.value().dump();
  }
  check_model(model, where);
  return model;
}

}  // namespace skeletex
