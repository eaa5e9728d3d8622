#include "known_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

#include "cad/alignment.h"
#include "core/errors.h"
#include "known_parts.h"
#include "warped_shape.h"

namespace cadmorph::testing {
namespace {

using Eigen::Vector3d;
using Words = std::vector<std::string>;

// Of the diagonal: what a motion may be missed by. The file's tolerance is 1e-7 of a part's size.
constexpr double kFound = 1e-6;

Words words_of(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}

/// FNV-1a, so that a row's shuffle does not depend on the rows before.
unsigned seed_of(const std::string& text) {
  unsigned hash = 2166136261u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  return hash;
}

/// What moves a part as a whole, in the order in which it is applied.
struct WholeMotion {
  gp_Trsf exact;
  bool is_mirrored = false, is_sheared = false, is_bent = false, is_any = false;

  bool take(const std::string& name, double amount) {
    gp_Trsf one;
    if (name == "turn")
      one.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(1, 2, 3)), amount);
    else if (name == "spin")
      one.SetRotation(gp::OZ(), amount);
    else if (name == "move")
      one.SetTranslation(amount * gp_Vec(3, -7, 11) / std::sqrt(179));
    else if (name == "scale")
      one.SetScale(gp_Pnt(0, 0, 0), amount);
    else if (name == "mirror")
      one.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp::DX()));
    else if (name == "sheared")
      is_sheared = true;
    else if (name == "bent")
      is_bent = true;
    else
      return false;
    is_mirrored |= name == "mirror";
    is_any = true;
    exact = one * exact;
    return true;
  }

  bool is_exact() const { return !is_mirrored && !is_sheared && !is_bent; }

  TopoDS_Shape operator()(const TopoDS_Shape& shape) const {
    if (is_sheared)
      return transformed(
          shape, gp_GTrsf(gp_Mat(1.2, 0.15, 0, 0, 0.9, 0.1, 0.05, 0, 1.1), gp_XYZ(7, -3, 5)));
    if (!is_bent) return transformed(shape, exact);
    const double size = to_model(shape).diagonal();
    return warped(shape, [size](const Vector3d& x) -> Vector3d {
      const double turn = 0.5 * x.z() / size;
      return {std::cos(turn) * x.x() - std::sin(turn) * x.y() + 0.2 * x.z() * x.z() / size,
              std::sin(turn) * x.x() + std::cos(turn) * x.y(), 1.1 * x.z()};
    });
  }
};

/// The part of these sizes. Many rows share it, and Booleans take longer than a match.
const NamedShape& made(const KnownPart& part, const Sizes& sizes) {
  static std::map<std::pair<std::string, Sizes>, NamedShape> shapes;
  const auto [at, is_new] = shapes.try_emplace({part.name, sizes});
  if (is_new) at->second = part.make(sizes);
  return at->second;
}

struct Changed {
  NamedShape part;
  std::optional<gp_Trsf> motion;
};

Changed changed(const KnownPart& part, const std::string& change) {
  Sizes sizes = part.sizes;
  WholeMotion motion;
  bool is_same_shape = true;
  const Words words = words_of(change);
  for (std::size_t i = 0; i + 1 < words.size(); i += 2) {
    const double amount = std::stod(words[i + 1]);
    if (motion.take(words[i], amount)) continue;
    const bool is_added = words[i + 1].front() == '+' || words[i + 1].front() == '-';
    double& size = sizes[words[i]];
    size = is_added ? size + amount : size * amount;
    is_same_shape &= words[i] == "seam" || words[i] == "first";
  }
  Changed result{made(part, sizes), {}};
  if (motion.is_any) result.part.shape = motion(result.part.shape);
  if (is_same_shape && motion.is_exact()) result.motion = motion.exact;
  return result;
}

KnownModel saved(NamedShape part, const std::string& how, unsigned seed) {
  const Words words = words_of(how);
  const auto has = [&](const char* word) { return std::ranges::count(words, word) > 0; };
  if (has("nurbs")) part.shape = to_nurbs(part.shape);
  const ShuffleOptions options{.seed = seed,
                               .is_order_shuffled = has("order"),
                               .has_reversed_planes = has("planes"),
                               .has_reversed_edges = has("edges"),
                               .has_reversed_surfaces = has("surfaces"),
                               .has_split_seams = has("seams"),
                               .has_split_edges = has("splits")};
  const auto is_shuffle = [](const std::string& word) {
    return word != "nurbs" && word != "cut" && word != "step";
  };
  if (std::ranges::any_of(words, is_shuffle)) {
    const Shuffled shuffled = shuffle(part.shape, options);
    const std::vector<std::string> before = part.names;
    for (std::size_t f = 0; f < before.size(); ++f)
      part.names[static_cast<std::size_t>(shuffled.faces[FaceId(f)])] = before[f];
    part.shape = shuffled.shape;
  }
  if (!has("cut") && !has("step"))
    return {part.shape, to_model(part.shape), std::nullopt, part.names};
  const TopoDS_Shape shape = has("cut") ? with_cut_faces(part.shape) : part.shape;
  return {shape, has("step") ? through_step(shape) : to_model(shape), to_model(part.shape),
          part.names};
}

/// Faces of one name as the one face that they may be merged to.
EntityFeature whole_of(const std::vector<EntityFeature>& pieces) {
  EntityFeature whole{Vector3d::Zero(), 0};
  double area = 0;
  for (const EntityFeature& piece : pieces) {
    const double more = piece.size * piece.size;
    whole.centre += more * piece.centre;
    area += more;
  }
  whole.centre /= area;
  whole.size = std::sqrt(area);
  return whole;
}

/// The names of faces that lie where those of another model do, which has them by number, or where
/// all that have one name do.
std::vector<std::string> names_by_place(const CadModel& model, const CadModel& known,
                                        const std::vector<std::string>& names) {
  const auto features = entity_features(known);
  std::map<std::string, std::vector<EntityFeature>> pieces;
  std::vector<std::pair<EntityFeature, std::string>> places;
  for (std::size_t i = 0; i < names.size(); ++i) {
    places.emplace_back(features[i], names[i]);
    pieces[names[i]].push_back(features[i]);
  }
  for (const auto& [name, of_name] : pieces)
    if (of_name.size() > 1) places.emplace_back(whole_of(of_name), name);
  const auto from = entity_features(model);
  std::vector<std::string> found;
  for (const FaceId f : model.faces().ids()) {
    const auto distance = [&](const auto& place) {
      return (from[f].centre - place.first.centre).norm() +
             std::abs(from[f].size - place.first.size);
    };
    found.push_back(std::ranges::min_element(places, {}, distance)->second);
  }
  return found;
}

/// Names of curves and corners by the faces that they lie between.
struct SkeletonNames {
  std::vector<std::string> curves, corners;
};

SkeletonNames names_of(const CadModel& model, const std::vector<std::string>& faces) {
  const CadSkeleton& skeleton = model.skeleton();
  std::vector<std::set<std::string>> around(skeleton.corners.size());
  SkeletonNames names;
  for (const CadCurve& curve : skeleton.curves) {
    std::multiset<std::string> beside;
    for (const FaceId f : curve.faces) beside.insert(faces[static_cast<std::size_t>(f)]);
    std::string name;
    for (const std::string& face : beside) name += face + ' ';
    names.curves.push_back(name);
    for (const int corner : {curve.start, curve.end})
      if (corner >= 0)
        around[static_cast<std::size_t>(corner)].insert(beside.begin(), beside.end());
  }
  for (const auto& corner : around) {
    std::string name;
    for (const std::string& face : corner) name += face + ' ';
    names.corners.push_back(name);
  }
  for (const CurveId c : skeleton.curves.ids()) {
    const CadCurve& curve = skeleton.curves[c];
    std::set<std::string> ends;
    for (const int corner : {curve.start, curve.end})
      if (corner >= 0) ends.insert(names.corners[static_cast<std::size_t>(corner)]);
    for (const std::string& end : ends) names.curves[c] += "| " + end;
  }
  return names;
}

template <class Id>
int wrong_pairs(const std::vector<std::string>& base, const std::vector<std::string>& variant,
                const IdVector<Id, Id>& map) {
  int wrong = 0;
  for (const Id id : map.ids()) wrong += base[id] != variant[map[id]];
  return wrong;
}

double missed(const CadModel& base, const Similarity& found, const gp_Trsf& known) {
  double most = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d x(corner & 1 ? base.lower().x() : base.upper().x(),
                     corner & 2 ? base.lower().y() : base.upper().y(),
                     corner & 4 ? base.lower().z() : base.upper().z());
    most = std::max(most, (found(x) - apply(known, x)).norm());
  }
  return most;
}

}  // namespace

std::string to_string(const KnownPair& pair) {
  const auto part = [](const char* what, const std::string& text) {
    return text.empty() ? std::string() : what + text;
  };
  return pair.part + part(": ", pair.change) + part("; written with ", pair.written) +
         part("; base with ", pair.base_written);
}

MadePair make(const KnownPair& pair) {
  const KnownPart& part = known_part(pair.part);
  const unsigned seed = seed_of(to_string(pair));
  const Changed change = changed(part, pair.change);
  return {saved(made(part, part.sizes), pair.base_written, seed + 1),
          saved(change.part, pair.written, seed), change.motion, part.is_round};
}

std::string judge(const MadePair& pair, const MatchedModels& matched) {
  const auto names = [](const CadModel& model, const KnownModel& known) {
    return known.numbered ? names_by_place(model, *known.numbered, known.names) : known.names;
  };
  const auto base = names(matched.base, pair.base), variant = names(matched.variant, pair.variant);
  const TopologyMatch& match = matched.match;
  std::ostringstream text;
  if (const int wrong = wrong_pairs(base, variant, match.faces)) text << wrong << " faces wrong ";
  const auto skeleton = [&](const CadModel& model, const std::vector<std::string>& faces) {
    return match.joins_edges ? names_of(model.with_joined_edges(), faces) : names_of(model, faces);
  };
  const SkeletonNames b = skeleton(matched.base, base), v = skeleton(matched.variant, variant);
  if (const int wrong = wrong_pairs(b.curves, v.curves, match.curves))
    text << wrong << " curves wrong ";
  if (const int wrong = wrong_pairs(b.corners, v.corners, match.corners))
    text << wrong << " corners wrong ";
  if (pair.motion) {
    const bool is_still = pair.motion->Form() == gp_Identity;
    const double off = missed(matched.base, match.alignment, *pair.motion);
    if (!match.is_congruent) text << "the motion is not found ";
    if (off > kFound * matched.variant.diagonal() && (is_still || !pair.is_round))
      text << "the motion is missed by " << off << " mm ";
  }
  return text.str();
}

std::string outcome(const MadePair& pair) {
  try {
    return judge(pair, match_models(pair.base.model, pair.variant.model));
  } catch (const TopologyError& error) {
    return error.what();
  }
}

}  // namespace cadmorph::testing
