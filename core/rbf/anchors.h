#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "core/rbf/kernel.h"
#include "core/rbf/rbf_system.h"
#include "core/types.h"

namespace cadmorph {

/// No target of a bounded field moves farther than this many times the largest prescribed
/// displacement: about as far as by the kernel r, which does not run on in far fields, 1.0 to 1.23.
inline constexpr double kMostOvershoot = 1.2;

/// Targets that are prescribed, too, so that a field between them does not run on far away from
/// its centres; with the displacements they get.
struct Anchors {
  /// Those chosen together: an anchor's value is m + part (u - m), m the mean of all values, u what
  /// the interpolant of the carriers and the anchors before did there, or the whole field.
  struct Round {
    Index begin = 0;        ///< of the anchors; the next round's begin ends it
    bool is_field = false;  ///< u is the whole field's
    Eigen::VectorXd parts;
  };

  std::vector<Index> targets;  ///< rows
  RowMatrix values;
  std::vector<Round> rounds = {};
};

/// The largest displacement of the targets over the largest of the values; 0 where all values are.
double overshoot(const RowMatrix& values, const RowMatrix& displacements);

/// Anchors that turned out too few, and what all targets did with them (T x M).
struct TriedAnchors {
  Anchors anchors = {};
  RowMatrix displacements = {};
};

/// Chooses anchors among T x D targets for displacements at N x D centres (N x M values): few, the
/// nearer to the centres the closer to each other, until the interpolant by `kernel` keeps within
/// kMostOvershoot at a graded choice of the targets. An anchor's value is a mean of all values with
/// positive weights, area / distance^6 in space and length / distance^5 in a plane: far from a
/// small body the mean motion of the body, and the less of it the nearer that is which stays. None
/// where the interpolant keeps within the bound anyway, as every affine motion does; with the
/// anchors given their values are linear in the values.
///
/// `carriers`: rows of the centres that carry the values well enough to choose by, a few thousand
/// at most. Those `before` stay, and the targets that moved too far with them become anchors, too.
/// Throws SolverError where the carriers nearly coincide.
Anchors find_anchors(const RowMatrix& centres, const RowMatrix& values,
                     const std::vector<Index>& carriers, const Kernel& kernel,
                     const RowMatrix& targets, const TriedAnchors& before = {});

/// Whether a target moves farther than kMostOvershoot allows.
enum class OvershootGuess {
  None,
  Unknown,  ///< the field itself has to tell
  Likely,
};

/// Guesses of displacements, at little cost, whether anchors may be needed: by some centres that
/// move and some that rest, at the graded choice of the targets that find_anchors goes by.
class OvershootCheck {
 public:
  /// `centres`: N x 3. `targets`: T x 3.
  OvershootCheck(RowMatrix centres, const Kernel& kernel, const RowMatrix& targets);

  /// For N x 3 values at the centres. None is a guess, too, but a cautious one: Unknown where half
  /// of the centres taken would say something else, or these miss the values of others.
  OvershootGuess guess(const RowMatrix& values) const;

 private:
  RowMatrix by_probes(const RowMatrix& values, Index count, const RowMatrix& targets) const;

  RowMatrix centres_, candidates_;
  std::vector<Index> order_;  // of the centres, from coarse to fine
  Kernel kernel_;
};

/// How the values of anchors depend on those at the centres, with the anchors and their parts
/// fixed: a linear map and its transpose.
class AnchorDerivative {
 public:
  /// What the whole field of so many of the anchors does at targets (rows), by the values at the
  /// centres and these anchors: for the rounds that go by it.
  using FieldOf = std::function<RbfDerivative(Index anchors, const std::vector<Index>& targets)>;

  /// The first `count` of the anchors that find_anchors chose for the same arguments.
  AnchorDerivative(const RowMatrix& centres, const std::vector<Index>& carriers,
                   const Kernel& kernel, const RowMatrix& targets, const Anchors& anchors,
                   Index count, const FieldOf& field);

  /// Returns the anchors' values, A x M, for N x M values at the centres.
  Eigen::MatrixXd forward(const Eigen::MatrixXd& values) const;

  /// Returns N x M for slopes (A x M) by the anchors' values.
  Eigen::MatrixXd adjoint(Eigen::MatrixXd slopes) const;

  Index size() const { return count_; }  ///< A

 private:
  struct Step {
    Index begin, end;
    Eigen::VectorXd parts;
    std::vector<Index> inputs;  // centres whose values, with those of the anchors before, give u
    RbfDerivative field;
    Eigen::MatrixXd means;  // weights of the values at all centres
  };

  Index centres_, count_;
  std::vector<Step> steps_;
};

/// A few displacement fields, each as much as a linear functional of the values says.
struct LowRankMap {
  Eigen::MatrixXd functionals;  ///< R x N
  Eigen::MatrixXd fields;       ///< T x R
};

/// The derivative of a field by the values at its centres, where anchors hold it by way of these.
struct FieldMap {
  RbfDerivative field;  ///< by the values at the centres and, below them, at the anchors
  std::optional<AnchorDerivative> anchors = {};
  std::optional<LowRankMap> more = {};  ///< added to that

  /// T x M for N x M values, and N x M for T x M slopes.
  Eigen::MatrixXd forward(const Eigen::MatrixXd& values) const;
  Eigen::MatrixXd adjoint(const Eigen::MatrixXd& slopes) const;

 private:
  Eigen::MatrixXd forward_held(const Eigen::MatrixXd& values) const;
  Eigen::MatrixXd adjoint_held(const Eigen::MatrixXd& slopes) const;
};

/// The targets' displacements (T x M) by the interpolant of all values, held by anchors where it
/// would overshoot and anchors can be found; for a few thousand centres at most. Throws what
/// RbfSystem throws.
RowMatrix interpolate_bounded(const RowMatrix& centres, const RowMatrix& values,
                              const Kernel& kernel, const RowMatrix& targets);

/// The derivative of that by the values, the anchors held that these values took.
FieldMap bounded_derivative(const RowMatrix& centres, const RowMatrix& values, const Kernel& kernel,
                            const RowMatrix& targets);

}  // namespace cadmorph
