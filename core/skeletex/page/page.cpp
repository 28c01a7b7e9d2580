// SPDX-License-Identifier: MIT
#include "skeletex/page/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "skeletex/analysis/metro.h"
#include "skeletex/compact/compact_file.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/convert/resample/levels.h"
#include "skeletex/device/kernel_source.h"
#include "skeletex/edit/morph/morph.h"
#include "skeletex/edit/transfer/transfer.h"
#include "skeletex/geometry/best_rotation.h"
#include "skeletex/model/error.h"
#include "skeletex/page/pack.h"
#include "skeletex/page/stage.h"
#include "skeletex/reconstruct/reconstruct_mesh.h"
#include "skeletex/skeleton/pose.h"

namespace skeletex {

/// The page without its data; its text is empty when npm was missing at build time.
std::span<const EmbeddedKernelFile> embedded_page_files();

namespace {

using Json = nlohmann::ordered_json;

constexpr double kTexelStep = 5e-6;  // diagonals
constexpr int kKeys = 16;            // intervals of a morph
constexpr double kSwitch = 1e-4;     // where the seams of a morph change, it is found to this part of the way
constexpr double kNearEnd = 1e-7;    // where the tables of a model without weight are taken
constexpr std::string_view kPlaceOfData = "<!-- skeletex data -->";

Json to_json(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

/// The keys of a morph, and two more around every place where its seams change.
std::vector<PageKey> morph_keys(const Morph& morph) {
  const auto weights_at = [](double t) { return std::vector<double>{1 - t, t}; };
  const auto at = [&](double t) {
    MorphPlan plan = morph.plan(weights_at(std::clamp(t, kNearEnd, 1 - kNearEnd)));
    return PageKey{t, morph.at(weights_at(t)), std::move(plan.tables), std::move(plan.moves)};
  };
  std::vector<PageKey> keys{at(0)};
  for (int i = 1; i <= kKeys; ++i) {
    PageKey next = at(static_cast<double>(i) / kKeys);
    while (!has_same_seams(keys.back().model, next.model)) {
      const SkeletexModel& before = keys.back().model;
      double low = keys.back().t, high = next.t;
      while (high - low > kSwitch) {
        const double middle = (low + high) / 2;
        const bool is_same = has_same_seams(before, morph.without_texels(weights_at(middle)));
        (is_same ? low : high) = middle;
      }
      if (low > keys.back().t) keys.push_back(at(low));
      if (high >= next.t) break;
      keys.push_back(at(high));
    }
    keys.push_back(std::move(next));
  }
  return keys;
}

/// The skeleton, and for a morph what mean_nodes takes: the second one's nodes and the rotation to them.
Json skeleton_json(std::span<const PageKey> keys, const PageOptions& options) {
  const Skeleton& skeleton = keys.front().model.skeleton;
  Json json{{"nodes", Json::array()}, {"bones", Json::array()}, {"first", Json::array()}, {"keys", Json::array()}};
  std::vector<Vec3> first, second;
  for (const Node& node : skeleton.nodes) {
    json["nodes"].push_back(node.name);
    json["first"].push_back(to_json(node.position));
    first.push_back(node.position);
  }
  for (const Bone& bone : skeleton.bones)
    json["bones"].push_back({{"name", bone.name}, {"head", bone.head}, {"tail", bone.tail}});
  if (options.second) {
    json["second"] = Json::array();
    const Skeleton other = in_frame(options.second->model.skeleton, skeleton.frame);
    for (const NodeIndex node : options.second->correspondence.nodes) {
      second.push_back(other.nodes[node].position);
      json["second"].push_back(to_json(second.back()));
    }
    for (std::vector<Vec3>* nodes : {&first, &second}) {
      const Vec3 centre =
          std::accumulate(nodes->begin(), nodes->end(), Vec3(Vec3::Zero())) / static_cast<double>(nodes->size());
      for (Vec3& node : *nodes) node -= centre;
    }
    const Eigen::Quaterniond turn = best_rotation(first, second);
    const double sign = turn.w() < 0 ? -1 : 1;
    json["turn"] = {sign * turn.x(), sign * turn.y(), sign * turn.z(), sign * turn.w()};
  }
  for (const PageKey& key : keys) {
    Json directions = Json::array();
    for (const BoneBasis& basis : bone_bases(key.model.skeleton)) directions.push_back(to_json(basis.s));
    json["keys"].push_back({{"t", key.t}, {"s", directions}});
  }
  return json;
}

std::vector<float> rows_of(const SkeletexModel& model) {
  std::vector<float> rows;
  for (const Patch& patch : model.patches)
    for (const double u : patch.row_u) rows.push_back(static_cast<float>(u));
  return rows;
}

Json rectangles_json(const SkeletexModel& model) {
  Json json;
  json["width"] = model.texture.width;
  json["height"] = model.texture.height;
  json["patches"] = Json::array();
  for (const Patch& patch : model.patches) {
    const auto [x, y, width, height] = patch.rectangle;
    json["patches"].push_back({x, y, width, height});
  }
  return json;
}

Json texture_json(PageArrays& arrays, const SkeletexModel& model) {
  Json json = add_texels(arrays, model.texture, model.patches, kTexelStep * model.diagonal);
  json.update(rectangles_json(model));
  return json;
}

/// What a transfer makes of every bone by itself, in one texture: seams stay, so any choice of bones fits together.
Json transfer_json(ClContext& context, PageArrays& arrays, const SkeletexModel& source, const SkeletexModel& target,
                   const Correspondence& correspondence) {
  SkeletexModel all = target;
  Json refused = Json::array();
  for (BoneIndex bone = 0; bone < static_cast<int>(target.patches.size()); ++bone) {
    try {
      const SkeletexModel one =
          transfer(context, source, target,
                   {{source.skeleton.bones[correspondence.bones[bone]].name, target.skeleton.bones[bone].name}});
      all.patches[bone] = one.patches[bone];
      const auto [x, y, width, height] = target.patches[bone].rectangle;
      for (int row = y; row < y + height; ++row)
        for (const auto plane :
             {&DisplacementTexture::along, &DisplacementTexture::around, &DisplacementTexture::out}) {
          const auto begin = static_cast<std::ptrdiff_t>(row) * target.texture.width + x;
          std::copy_n((one.texture.*plane).begin() + begin, width, (all.texture.*plane).begin() + begin);
        }
    } catch (const InputError& error) {
      refused.push_back({{"bone", bone}, {"why", error.what()}});
    }
  }
  Json json = texture_json(arrays, all);
  json["rows"] = arrays.add(rows_of(all));
  json["refused"] = refused;
  return json;
}

/// Distances of the lattice's vertices to a mesh, in 65535ths of the largest.
Json error_json(ClContext& context, PageArrays& arrays, const SkeletexModel& model, const TriangleMesh& reference) {
  const std::vector<float> distances =
      closest_distances(context, reference, reconstruct_mesh(context, model).positions);
  std::vector<float> shares;
  const double diagonal = bounding_box(reference).diagonal();
  for (const float distance : distances) shares.push_back(static_cast<float>(distance / diagonal));
  std::vector<float> sorted = shares;
  const auto at = sorted.begin() + static_cast<std::ptrdiff_t>((sorted.size() - 1) * 99 / 100);
  std::nth_element(sorted.begin(), at, sorted.end());
  const float highest = *std::max_element(shares.begin(), shares.end());
  std::vector<unsigned char> low, high;
  for (const float share : shares) {
    const auto step = static_cast<unsigned>(std::lround(65535 * (highest > 0 ? share / highest : 0)));
    low.push_back(static_cast<unsigned char>(step & 255U));
    high.push_back(static_cast<unsigned char>(step >> 8U));
  }
  return {{"scale", std::max(*at, 1e-12f)}, {"highest", highest}, {"low", arrays.add(low)}, {"high", arrays.add(high)}};
}

/// One level of detail, whose arrays are a part of the page.
Json level_json(ClContext& context, PageArrays& arrays, std::span<const PageKey> keys, const PageOptions& options) {
  const SkeletexModel& first = keys.front().model;
  const bool is_decoded = options.compact && !options.second;
  Json level = is_decoded ? rectangles_json(first) : texture_json(arrays, first);
  if (!is_decoded) level["rows"] = arrays.add(rows_of(first));
  level["stages"] = Json::array();
  for (std::size_t begin = 0; begin < keys.size();) {
    std::size_t end = begin + 1;
    while (end < keys.size() && has_same_seams(keys[begin].model, keys[end].model)) ++end;
    level["stages"].push_back(add_stage(context, arrays, keys.subspan(begin, end - begin), is_decoded));
    begin = end;
  }
  if (options.reference) level["error"] = error_json(context, arrays, first, *options.reference);
  return level;
}

/// The levels of a morph, the finest first. Their arrays are added in the other order.
Json morph_levels(ClContext& context, PageArrays& arrays, const SkeletexModel& model, const PageOptions& options,
                  Json& skeleton) {
  Json levels = Json::array();
  const PageSecond& second = *options.second;
  const int finest = std::max(model.texture.width, model.texture.height);
  std::vector<int> sizes{finest};  // the coarsest first
  while (sizes.front() / 2 >= std::max(4, options.smallest)) sizes.insert(sizes.begin(), sizes.front() / 2);
  for (const int size : sizes) {
    try {
      const Morph morph(context, {model, second.model}, std::span(&second.correspondence, 1),
                        {.layout = 0, .size = size, .has_own_texels = false, .is_smooth = false});
      const std::vector<PageKey> keys = morph_keys(morph);
      skeleton = skeleton_json(keys, options);
      Json level = level_json(context, arrays, keys, options);
      const SkeletexModel& source = morph.models()[1];
      level["second"] = texture_json(arrays, source);
      level["second"]["rows"] = arrays.add(rows_of(keys.back().model));
      level["blend"] = add_blend(arrays, morph, keys);
      level["transfer"] = transfer_json(context, arrays, source, keys.front().model, second.correspondence);
      arrays.end_part();
      levels.insert(levels.begin(), std::move(level));
    } catch (const InputError&) {
      if (size == finest) throw;  // a coarser one is too small for the number of bones
    }
  }
  return levels;
}

/// The compact model without what the page's script does not decode.
CompactModel without_layers(CompactModel compact) {
  compact.layers.clear();
  for (CompactPatch& patch : compact.patches) patch.planes.clear();
  return compact;
}

/// The sizes of a compact model from that of the page down, each with half the rows and columns of the one before.
std::vector<SkeletexModel> compact_levels(const PageCompact& compact, const SkeletexModel& model, int smallest) {
  std::vector<SkeletexModel> levels{model};
  int octaves = compact.octaves, size = decoded_size(compact.model, octaves);
  for (;;) {
    const int next = decoded_size(compact.model, --octaves);
    if (next < smallest || next > 0.75 * size) return levels;  // the coarsest grids cannot be halved
    levels.push_back(decode_model(compact.model, octaves));
    size = next;
  }
}

std::span<const unsigned char> bytes_of(std::string_view text) {
  return {reinterpret_cast<const unsigned char*>(text.data()), text.size()};
}

/// The levels of one model, the finest first. Their arrays are added in the other order. Levels of a compact model hold
/// what its payload adds to that of the coarser ones.
Json model_levels(ClContext& context, PageArrays& arrays, const SkeletexModel& model, const PageOptions& options) {
  const std::vector<SkeletexModel> levels = options.compact ? compact_levels(*options.compact, model, options.smallest)
                                                            : make_levels(context, model, options.smallest);
  CompactModel compact;
  std::string payload;
  if (options.compact) {
    compact = without_layers(options.compact->model);
    payload = compact_payload(compact);
  }
  const int bare_levels = compact.bare_levels;
  std::size_t sent = 0;
  Json json = Json::array();
  for (int i = static_cast<int>(levels.size()) - 1; i >= 0; --i) {
    const std::vector<PageKey> keys{{0, levels[i], {}, {}}};
    Json level = level_json(context, arrays, keys, options);
    if (options.compact) {
      const int octaves = options.compact->octaves - i;
      compact.bare_levels = std::max(bare_levels, unused_steps(compact, octaves));
      const std::size_t end = compact_payload(compact).size();
      level["octaves"] = octaves;
      level["payload"] = arrays.add(bytes_of(payload).subspan(sent, end - sent));
      sent = end;
    }
    arrays.end_part();
    json.insert(json.begin(), std::move(level));
  }
  return json;
}

/// Gives the page's script a part of its data as soon as the browser has read it.
std::string data_script(std::string_view text) { return fmt::format("<script>addPart(\"{}\")</script>\n", text); }

bool stands_along_z(const SkeletexModel& model) {
  return model.stance && std::abs(model.stance->up.z()) > std::abs(model.stance->up.y());
}

/// The angle of the model's front about up, from z, or from -y where up is z.
double front_angle(const SkeletexModel& model, bool is_z_up) {
  if (!model.stance || is_z_up != stands_along_z(model)) return 0;
  const Vec3& front = model.stance->front;
  return std::atan2(front.x(), is_z_up ? -front.y() : front.z());
}

}  // namespace

bool has_page_script() { return !embedded_page_files().front().text.empty(); }

std::string make_page(ClContext& context, const SkeletexModel& model, const PageOptions& options) {
  if (!has_page_script())
    throw InputError(
        "this build has no script for pages; install nodejs and npm (scripts/install-dependencies.sh), then configure "
        "and build again");
  PageArrays arrays;
  Json json{{"version", 1}, {"name", options.name}};
  json["second"] = options.second ? Json(options.second->name) : Json();
  const bool is_z_up = options.is_z_up.value_or(stands_along_z(model));
  json["up"] = is_z_up ? "z" : "y";
  json["front"] = front_angle(model, is_z_up);
  json["diagonal"] = model.diagonal;
  json["origin"] = to_json(model.origin);
  const UnitFrame& frame = model.skeleton.frame;
  json["frame"] = {{"offset", to_json(frame.offset)}, {"scale", frame.scale}};
  json["roots"] = root_nodes(model.skeleton);
  if (options.second) {
    Json skeleton;
    json["levels"] = morph_levels(context, arrays, model, options, skeleton);
    json["skeleton"] = skeleton;
  } else {
    json["skeleton"] = skeleton_json(std::vector<PageKey>{{0, model, {}, {}}}, options);
    json["levels"] = model_levels(context, arrays, model, options);
  }
  json["bytes"] = arrays.size();
  std::string data = data_script(compressed_text(bytes_of(json.dump())));
  for (const std::string& part : arrays.texts()) data += data_script(part);
  std::string page(embedded_page_files().front().text);
  const std::size_t place = page.find(kPlaceOfData);
  if (place == std::string::npos) throw InputError("the page's script has no place for data; build again");
  return page.replace(place, kPlaceOfData.size(), data);
}

}  // namespace skeletex
