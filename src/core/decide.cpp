#include "tabletop_perception/decide.h"

#include <algorithm>
#include <cmath>

#include "clustered_scene.h"
#include "free_turn.h"
#include "lift.h"
#include "marks.h"
#include "polish_pose.h"
#include "refusals.h"
#include "settle_turn.h"
#include "tabletop_perception/normals.h"
#include "tabletop_perception/symmetry.h"

namespace tabletop_perception {
namespace {

constexpr std::size_t MAX_COLORED_POINTS = 600;  // that turn it as its colours are
constexpr double MIN_PROMISE_RATIO = 0.6;        // of a candidate to the best one of its proposal
constexpr double TWIN_SHIFT = 0.002;             // of two hypotheses that are one [m]
constexpr double TWIN_TURN = 0.02;               // [rad]
constexpr double MIN_OWN_SHARE = 0.7;  // of an object's points that no other object explains
constexpr double RIVAL_OVERLAP = 0.5;  // share of an object's points that a rival explains as well
constexpr double MIN_SHARE_OF_CLUSTER = 0.3;  // that an object explains if the cluster shows it
constexpr double TAKEN_SHARE = 0.5;     // of a cluster that objects explain: it is no unknown thing
constexpr double SETTLED_LIFT = 0.008;  // by which settling may raise or lower a thing [m]
constexpr double SETTLED_COLOR_GAIN = 1.25;  // by which it may make colours more alike
constexpr double MIN_LEFT_SHARE = 0.15;      // of a cluster that is worth another look
constexpr double FOLLOWED_SHIFT = 0.01;      // farthest that a thing at rest seems to move [m]
constexpr double FOLLOWED_TURN = 0.1;        // [rad]
constexpr double AS_GOOD = 0.9;  // agreement of what is followed, of what it was decided by

Eigen::Vector3f middleOf(const std::vector<Surface>& parts) {
  std::vector<Eigen::Vector3f> points;
  for (const auto& part : parts)
    points.insert(points.end(), part.points.begin(), part.points.end());
  return centroidOf(points);
}

/// A candidate after ICP, and what the camera says about it.
struct Hypothesis {
  int model;
  Eigen::Isometry3d T_camera_object;
  Verification verification;
  Marks explained;
  int points;       ///< that it explains
  double rms = 0;   ///< distance of the points about it from its tangent planes [m]
  double turn = 1;  ///< probability of its turn among those that look nearly alike
  PoseUncertainty uncertainty;
  double lead = 1;  ///< its margin is no larger: what it was when it was decided

  double worth() const { return verification.score * points; }
  bool stands() const { return verification.reason.empty(); }
};

/// The candidates of one scene, refined and verified, and the objects chosen among them.
class Decision {
 public:
  Decision(const Cloud& scene, const std::vector<Indices>& clusters,
           const std::vector<Table>& tables, const ModelIndex& index, const MatchOptions& match,
           const RefineOptions& refine, const VerifyOptions& verify)
      : scene_(scene),
        clusters_(clusters),
        tables_(tables),
        index_(index),
        match_(match),
        refine_(refine),
        verify_(verify),
        observations_(scene, tables),
        clustered_(scene, clusters, index),
        taken_(clustered_.parts()),
        reasons_(clusters.size()) {}

  /// Keeps what is expected and still there.
  void follow(const std::vector<SceneObject>& expected) {
    for (std::size_t e = 0; e < expected.size(); ++e) {
      const auto hypothesis = stillThere(expected[e]);
      if (!hypothesis) continue;
      taken_.mark(hypothesis->explained);
      objects_.push_back(knownObject(polished(*hypothesis)));
      objects_.back().followed = e;
    }
  }

  void judge(const Proposal& proposal) {
    const bool known =
        std::all_of(proposal.labels.begin(), proposal.labels.end(), [&](const std::uint32_t label) {
          return clustered_.shareOf(taken_, label - 2) > 1 - MIN_LEFT_SHARE;
        });
    if (known) return;
    std::string& reason = reasons_.at(proposal.labels.front() - 2);
    const bool alone = proposal.labels.size() == 1;
    if (alone) reason = proposal.candidates.reason;
    if (!proposal.candidates) return;
    const std::string refusal =
        judgeCandidates(*proposal.candidates, clustered_.partsOf(proposal.labels));
    if (alone && reason.empty()) reason = refusal;
  }

  /// Keeps the hypotheses that stand up, the worthiest first, as long as their points are free.
  void choose() {
    std::stable_sort(hypotheses_.begin(), hypotheses_.end(),
                     [](const auto& a, const auto& b) { return a.worth() > b.worth(); });
    for (const auto& hypothesis : hypotheses_) {
      if (!hypothesis.stands()) continue;
      const int shared = commonOf(hypothesis.explained, taken_);
      if (shared > (1 - MIN_OWN_SHARE) * hypothesis.points) continue;
      const double most = mostOf(hypothesis);
      if (most < verify_.min_score) {
        noteRefusal(hypothesis, refusals::scoreAtMost(nameOf(hypothesis), most, verify_.min_score));
        continue;
      }
      Hypothesis settled = hypothesis;
      settle(settled);
      const double score = probabilityOf(evidenceOf(settled));
      const bool likely = score >= verify_.min_score;
      if (!likely && score < verify_.min_score * settled.turn) {
        noteRefusal(hypothesis, refusals::score(nameOf(settled), score, verify_.min_score));
        continue;
      }
      // Whichever way it is turned, it is there: nothing else is made of its points.
      const std::string refusal =
          likely ? marginRefusal(hypothesis)
                 : refusals::turn(nameOf(settled), settled.turn, score, verify_.min_score);
      taken_.mark(hypothesis.explained);
      if (refusal.empty()) {
        objects_.push_back(knownObject(polished(settled)));
        continue;
      }
      undecided_.push_back(hypothesis.explained);
      noteRefusal(hypothesis, refusal);
    }
    hypotheses_.clear();
  }

  Evidence evidenceOf(const Hypothesis& hypothesis) const {
    const double leaf = index_.descriptorOptions().leaf;
    return {hypothesis.verification.agreement,
            hypothesis.rms,
            hypothesis.points * leaf * leaf,
            std::min(rivalOf(hypothesis).margin, hypothesis.lead),
            liftOf(hypothesis),
            hypothesis.turn};
  }

  /// The score that a hypothesis may have at most once it is settled, which takes much longer.
  double mostOf(const Hypothesis& hypothesis) const {
    Evidence best{hypothesis.verification.agreement, 0, 0, 1, 0, 1};
    const double leaf = index_.descriptorOptions().leaf;
    best.area = hypothesis.points * leaf * leaf;
    auto& color = best.agreement.color;
    if (color) color = *color * SETTLED_COLOR_GAIN;
    if (probabilityOf(best) < verify_.min_score) return probabilityOf(best);
    best.lift = std::max(0.0, std::abs(liftOf(hypothesis)) - SETTLED_LIFT);
    return probabilityOf(best);
  }

  /// Turns an object the way that fits best, where its points leave the turn free or it is nearly
  /// symmetric.
  void settle(Hypothesis& hypothesis) const {
    const Surface around = clustered_.samplesAround(hypothesis.model, hypothesis.T_camera_object,
                                                    hypothesis.explained);
    const Observation& observation = observations_.about(centroidOf(around.points));
    const auto points = clustered_.pointsOfClusters(hypothesis.explained);
    hypothesis.T_camera_object = bestFreeTurn(index_, hypothesis.model, hypothesis.T_camera_object,
                                              around, observation, verify_.tolerance, refine_);
    std::optional<SeenOutline> outline;
    if (observation.projection)
      outline.emplace(observation, index_, hypothesis.model, hypothesis.T_camera_object);
    const SeenOutline* seen = outline ? &*outline : nullptr;
    const auto settled = settleTurn(index_, hypothesis.model, hypothesis.T_camera_object, points,
                                    coloredOf(hypothesis), seen, tables_, refine_);
    if (!settled) return;
    hypothesis.T_camera_object = settled->T_camera_object;
    hypothesis.rms = settled->rms;
    hypothesis.turn = settled->probability;
    if (settled->color) hypothesis.verification.agreement.color = settled->color;
  }

  /// With the pose that leaves, and how far that may be off.
  Hypothesis polished(Hypothesis hypothesis) const {
    const auto& observation =
        observations_.about(hypothesis.T_camera_object.translation().cast<float>());
    const auto pose =
        polishPose(index_, hypothesis.model, hypothesis.T_camera_object,
                   clustered_.pointsOfClusters(hypothesis.explained), observation, refine_);
    hypothesis.T_camera_object = pose.T_camera_object;
    hypothesis.uncertainty = pose.uncertainty;
    return hypothesis;
  }

  /// Matches what is left of clusters that objects were found in.
  void judgeRest(const std::vector<Proposal>& proposals) {
    for (const auto& proposal : proposals) {
      if (!isWorthAnotherLook(proposal.labels)) continue;
      const Parts parts = clustered_.restOf(proposal.labels, taken_);
      Surface all;
      for (const auto& part : parts.surfaces) {
        all.points.insert(all.points.end(), part.points.begin(), part.points.end());
        all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
      }
      const auto candidates =
          matchCluster(all, observations_.about(centroidOf(all.points)), index_, match_);
      if (candidates) judgeCandidates(*candidates, parts);
    }
  }

  std::vector<SceneObject> objects() && {
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      double decided = clustered_.shareOf(taken_, k);
      for (const auto& marks : undecided_) decided -= clustered_.shareOf(marks, k);
      if (decided >= TAKEN_SHARE) continue;
      objects_.push_back(
          unknownObject(scene_, clusters_[k], static_cast<std::uint32_t>(k) + 2, mainTable()));
      objects_.back().reason = reasons_[k].empty() ? "part of several things" : reasons_[k];
    }
    std::stable_sort(objects_.begin(), objects_.end(), [](const auto& a, const auto& b) {
      return a.labels.front() < b.labels.front();
    });
    return std::move(objects_);
  }

 private:
  /// Adds a hypothesis for each candidate that ICP holds on to; why the best one is refused.
  std::string judgeCandidates(const std::vector<Candidate>& candidates, const Parts& parts) {
    const Observation& observation = observations_.about(middleOf(parts.surfaces));
    std::string reason;
    double best_score = -1;
    for (const auto& candidate : candidates) {
      const int model = index_.find(candidate.name);
      if (model < 0) {  // taken out of the database meanwhile
        if (reason.empty()) reason = "what it looked like is no longer in the database";
        continue;
      }
      if (candidate.promise < MIN_PROMISE_RATIO * candidates.front().promise) continue;
      const auto alignment =
          refinePose(clustered_.sourceFor(model, candidate.T_camera_object, parts),
                     index_.grid(model), candidate.T_camera_object, refine_);
      if (!alignment) {
        if (reason.empty()) reason = alignment.reason;
        continue;
      }
      const Eigen::Isometry3d T_camera_object =
          canonicalPose(index_.models()[model].symmetry, alignment->T_camera_object, reference());
      Hypothesis hypothesis{
          model,
          T_camera_object,
          verifyPose(index_, model, T_camera_object, parts.planar, observation, verify_),
          Marks(clustered_.parts()),
          0,
          0,
          1,
          {},
          1};
      if (hypothesis.verification.score > best_score) {
        best_score = hypothesis.verification.score;
        reason = hypothesis.stands() ? "" : candidate.name + ": " + hypothesis.verification.reason;
      }
      if (!hypothesis.stands()) continue;
      const auto twin = twinOf(hypothesis);
      if (twin != hypotheses_.end() && twin->verification.score >= hypothesis.verification.score)
        continue;
      markExplained(hypothesis);
      if (twin != hypotheses_.end())
        *twin = std::move(hypothesis);
      else
        hypotheses_.push_back(std::move(hypothesis));
    }
    return reason;
  }

  /// An expected object where it was, if it agrees with what the camera sees as it did.
  std::optional<Hypothesis> stillThere(const SceneObject& expected) const {
    const int model = index_.find(expected.name);
    if (model < 0) return std::nullopt;
    const auto parts = clustered_.partsAbout(model, expected.T_camera_object);
    if (parts.surfaces.empty()) return std::nullopt;
    const auto alignment = refinePose(clustered_.sourceFor(model, expected.T_camera_object, parts),
                                      index_.grid(model), expected.T_camera_object, refine_);
    if (!alignment || !samePose(Symmetry(), expected.T_camera_object, alignment->T_camera_object,
                                FOLLOWED_SHIFT, FOLLOWED_TURN))
      return std::nullopt;
    const Evidence& before = expected.evidence;
    Hypothesis hypothesis{model,
                          alignment->T_camera_object,
                          verifyPose(index_, model, alignment->T_camera_object, parts.planar,
                                     observations_.about(middleOf(parts.surfaces)), verify_),
                          Marks(clustered_.parts()),
                          0,
                          before.rms,
                          before.turn,
                          {},
                          before.margin};
    if (!hypothesis.stands() ||
        hypothesis.verification.score < AS_GOOD * before.agreement.score(verify_.tolerance))
      return std::nullopt;
    markExplained(hypothesis);
    if (commonOf(hypothesis.explained, taken_) > (1 - MIN_OWN_SHARE) * hypothesis.points ||
        probabilityOf(evidenceOf(hypothesis)) < verify_.min_score)
      return std::nullopt;
    return hypothesis;
  }

  void markExplained(Hypothesis& hypothesis) const {
    hypothesis.explained =
        clustered_.explainedBy(hypothesis.model, hypothesis.T_camera_object, verify_.tolerance);
    hypothesis.points = hypothesis.explained.count();
  }

  /// The hypothesis of the same object at the same place, which another cluster or union led to.
  std::vector<Hypothesis>::iterator twinOf(const Hypothesis& hypothesis) {
    const Symmetry& symmetry = index_.models()[hypothesis.model].symmetry;
    return std::find_if(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& other) {
      return other.model == hypothesis.model &&
             samePose(symmetry, other.T_camera_object, hypothesis.T_camera_object, TWIN_SHIFT,
                      TWIN_TURN);
    });
  }

  /// Some of the points that a hypothesis explains, with their colours where these are to count.
  ColoredPoints coloredOf(const Hypothesis& hypothesis) const {
    if (!verify_.color || index_.colors(hypothesis.model).empty()) return {};
    const auto points = clustered_.markedPoints(hypothesis.explained);
    if (points.empty()) return {};
    return coloredPoints(observations_.about(centroidOf(points)), points, MAX_COLORED_POINTS);
  }

  const std::string& nameOf(const Hypothesis& hypothesis) const {
    return index_.models()[hypothesis.model].name;
  }

  double liftOf(const Hypothesis& hypothesis) const {
    return tabletop_perception::liftOf(index_, hypothesis.model, hypothesis.T_camera_object,
                                       clustered_.parts(), hypothesis.explained, observations_,
                                       tables_);
  }

  void noteRefusal(const Hypothesis& hypothesis, const std::string& refusal) {
    for (std::size_t k = 0; k < clusters_.size(); ++k)
      if (clustered_.shareOf(hypothesis.explained, k) >= MIN_SHARE_OF_CLUSTER)
        reasons_[k] = refusal;
  }

  /// The other object that agrees best with what a hypothesis explains.
  struct Rival {
    const Hypothesis* hypothesis = nullptr;  ///< none: no other object stands there
    double margin = 1;                       ///< by which it agrees less
  };

  Rival rivalOf(const Hypothesis& best) const {
    Rival rival;
    for (const auto& other : hypotheses_) {
      if (other.model == best.model || !other.stands()) continue;
      const Agreement &a = best.verification.agreement, &b = other.verification.agreement;
      const bool by_color = a.color && b.color;  // else the model with colours would be worse off
      const auto scoreOf = [&](const Agreement& agreement) {
        return by_color ? agreement.score(verify_.tolerance)
                        : agreement.shapeScore(verify_.tolerance);
      };
      const double margin =
          scoreOf(a) - scoreOf(b) * std::min(1.0, static_cast<double>(other.points) / best.points);
      if (margin >= rival.margin) continue;
      if (commonOf(other.explained, best.explained) < RIVAL_OVERLAP * best.points) continue;
      rival = {&other, margin};
    }
    return rival;
  }

  std::string marginRefusal(const Hypothesis& best) const {
    const Rival rival = rivalOf(best);
    if (rival.margin >= verify_.min_margin) return "";
    return refusals::margin(nameOf(best), rival.margin, nameOf(*rival.hypothesis),
                            verify_.min_margin);
  }

  bool isWorthAnotherLook(const std::vector<std::uint32_t>& labels) const {
    bool begun = false, rest = true;
    for (const auto label : labels) {
      const double taken = clustered_.shareOf(taken_, label - 2);
      begun = begun || taken > 1 - MIN_OWN_SHARE;
      rest = rest && taken < 1 - MIN_LEFT_SHARE;
    }
    return begun && rest;
  }

  SceneObject knownObject(const Hypothesis& hypothesis) const {
    SceneObject object;
    object.name = nameOf(hypothesis);
    object.T_camera_object = hypothesis.T_camera_object;
    object.uncertainty = hypothesis.uncertainty;
    object.fitness = hypothesis.verification.agreement.fitness;
    object.visible = hypothesis.verification.agreement.visible;
    object.evidence = evidenceOf(hypothesis);
    object.score = probabilityOf(object.evidence);
    std::vector<double> shares;
    for (std::size_t k = 0; k < clusters_.size(); ++k)
      shares.push_back(clustered_.shareOf(hypothesis.explained, k));
    const double most = *std::max_element(shares.begin(), shares.end());
    std::vector<Eigen::Vector3f> points;
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      if (shares[k] < std::min(most, MIN_SHARE_OF_CLUSTER)) continue;
      object.labels.push_back(static_cast<std::uint32_t>(k) + 2);
      const auto near =
          clustered_.pointsNear(hypothesis.model, hypothesis.T_camera_object, k, verify_.tolerance);
      points.insert(points.end(), near.begin(), near.end());
    }
    object.points = static_cast<int>(points.size());
    object.box = boxAround(points, up());
    return object;
  }

  /// What symmetric objects are turned towards: the main table's axes, else the camera's.
  Eigen::Matrix3d reference() const {
    return tables_.empty() ? Eigen::Matrix3d::Identity()
                           : Eigen::Matrix3d(tables_.front().T_camera_table.linear());
  }

  std::optional<Table> mainTable() const {
    if (tables_.empty()) return std::nullopt;
    return tables_.front();
  }

  std::optional<Eigen::Vector3d> up() const {
    if (tables_.empty()) return std::nullopt;
    return tables_.front().plane.head<3>();
  }

  const Cloud& scene_;
  const std::vector<Indices>& clusters_;
  const std::vector<Table>& tables_;
  const ModelIndex& index_;
  const MatchOptions& match_;
  const RefineOptions& refine_;
  const VerifyOptions& verify_;
  Observations observations_;
  ClusteredScene clustered_;
  std::vector<Hypothesis> hypotheses_;
  Marks taken_;                       ///< points of objects, known or undecided
  std::vector<Marks> undecided_;      ///< points of things with too little margin
  std::vector<SceneObject> objects_;  ///< the known ones
  std::vector<std::string> reasons_;  ///< of each cluster, should it remain unknown
};

}  // namespace

SceneObject unknownObject(const Cloud& scene, const Indices& cluster, std::uint32_t label,
                          const std::optional<Table>& table) {
  SceneObject object;
  object.labels = {label};
  object.points = static_cast<int>(cluster.size());
  std::optional<Eigen::Vector3d> up;
  if (table) up = table->plane.head<3>();
  object.box = boxAround(pointsAt(scene, cluster), up);
  object.T_camera_object = object.box.T_camera_box;
  return object;
}

Surface sampleCluster(const Cloud& scene, const Indices& cluster,
                      const DescriptorOptions& options) {
  return sampleSurface(pointsAt(scene, cluster), options.leaf, options.normal_radius,
                       Eigen::Vector3f::Zero());
}

std::vector<SceneObject> decideObjects(const Cloud& scene, const std::vector<Indices>& clusters,
                                       const std::vector<Proposal>& proposals,
                                       const std::vector<Table>& tables, const ModelIndex& index,
                                       const MatchOptions& match, const RefineOptions& refine,
                                       const VerifyOptions& verify,
                                       const std::vector<SceneObject>& expected) {
  Decision decision(scene, clusters, tables, index, match, refine, verify);
  decision.follow(expected);
  for (const auto& proposal : proposals) decision.judge(proposal);
  decision.choose();
  decision.judgeRest(proposals);
  decision.choose();
  return std::move(decision).objects();
}

}  // namespace tabletop_perception
