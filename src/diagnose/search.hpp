/// @file
/// The search for effects: forward selection and backward checks on the training logs.
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "evidence.hpp"
#include "identified.hpp"
#include "refusals.hpp"
#include "rules.hpp"
#include "start.hpp"

namespace heft::diagnose {

/// The model while it grows.
class Search {
 public:
  Search(Start& start, const DiagnoseOptions& options);

  /// Takes the best candidate as long as there is one that nothing speaks against. May be called again to go on.
  /// @param may_stop  where a spring was taken that asks for another cut-off
  /// @return the least cut-off that it asks for [Hz]; 0: all candidates were looked at
  double forward(bool may_stop);
  /// Begins with the springs of a search of the same logs behind another cut-off.
  void take_springs_of(const Search& other);
  /// Takes each effect out again: one that another has made needless goes, one that another does better is exchanged. Where that
  /// one is of another place, goes forward again.
  void backward();
  /// The same of the effects of one joint, which were chosen next to one that is out; springs stay as they are.
  /// @return whether one went or was exchanged
  bool check_again(int joint);

  const Engine& engine() const { return *start_.engine; }
  /// Of the model as it is.
  std::shared_ptr<const Present> present();
  const Start& start() const { return start_; }
  const std::vector<NotExplained>& wrong_joints() const { return wrong_joints_; }
  /// Looks for joints that the model as it is does not explain.
  void check_joints();
  Rules rules() const { return {&engine(), &wrong_joints_, &refused_, options_.joint_sensor}; }
  int tried() const { return tried_; }

  /// Another model of the same logs. What it is compared with keeps its own.
  /// @param without  effect to leave out; -1: none
  /// @param standing_counts  see Engine
  /// @param and_without      another one to leave out
  std::unique_ptr<Engine> rebuilt(std::ptrdiff_t without, bool weights_held, bool masses_held,
                                  int standing_counts = -1, std::ptrdiff_t and_without = -1) const;
  std::unique_ptr<Engine> rebuilt_without(std::size_t index) const;
  /// The first of the other springs than an accepted one, which are looked at together; -1: none.
  std::ptrdiff_t other_spring(std::size_t effect) const;
  /// Possible forms of a memory, judged with everything else in place, the best first.
  /// @param standing  joints whose standstill counts beside that of the accepted memories, one after the other; see
  ///                  Engine::standing_counts
  std::vector<Candidate> forms_of_memory(std::size_t effect, std::initializer_list<int> standing) const;
  /// Candidates without an accepted effect, from the backward check or found now. May be asked for several at the same time.
  std::vector<Candidate> evidence(std::size_t effect);

  /// Goes on with another model.
  void take_over(std::unique_ptr<Engine> engine);
  void take_out(std::size_t effect, const std::string& why);
  /// The same for good: none of its kind is taken in that joint again.
  void take_out_for_good(std::size_t effect, const std::string& why);
  /// Takes rotor inertia and offset of a joint that nothing speaks against: what stood in their place is out. Only those that are
  /// columns of the identified model: it explains any other one, such as the offset of a vertical slide, by its masses and
  /// motors, so that reject_needless() would take it out again, without end.
  void take_rotor_and_offset(int joint, const Identified& identified);

  Refusals& refusals() { return refusals_; }
  const std::vector<std::string>& notes() const { return notes_; }

  /// @param done  of the whole diagnosis, 0 to 1
  void progress(double done) const;
  void trace(const std::string& what, const Eigen::MatrixXd& judged) const;
  void trace(const std::string& line) const;
  bool traces() const { return static_cast<bool>(options_.trace); }

 private:
  /// Parts of the time that have gone when effects were taken, and when each was looked at without the others.
  static constexpr double kForward = 0.6, kBackward = 0.7;

  /// To be changed.
  Engine& model() {
    present_.reset();
    return *start_.engine;
  }
  Candidate pair_for(const Candidate& spring, const std::vector<Candidate>& pool) const;
  double cutoff_for_springs() const;
  std::vector<bool> looked_at(const std::vector<int>& of) const;
  bool add_spring_pairs(const Engine& engine, const std::vector<int>& of, std::vector<Candidate>& pool) const;
  void add_scales_of_others(int joint, const Engine& rest, std::vector<Candidate>& found) const;
  bool one_scale_for_two();
  std::vector<Candidate> in_place_of(std::size_t effect, const Candidate& own, const Engine& rest) const;
  std::vector<Candidate> propose(const Engine& engine, const std::vector<int>& of,
                                 const std::function<void(double)>& done = {}, double least = 0.0) const;
  void find_again(int again, std::vector<std::shared_ptr<const Present>>& found_by, std::vector<Candidate>& pool,
                  const std::function<void(double)>& done);
  bool judge_simpler_again(std::vector<Candidate>& pool, const Candidate& best) const;
  const Candidate* best_of(std::vector<Candidate>& pool, const Rules::Round& round) const;
  void tune();
  bool find_motors();
  void take(const Candidate& candidate);
  void find_load_change_again();
  void find_memory_again(int joint);
  void trace_pool(const std::vector<Candidate>& pool, const Rules::Round& round) const;
  Evidence found_without(std::size_t effect);
  Evidence& without(std::size_t effect, bool with_columns);
  /// What does best in the place of an effect.
  struct InPlace {
    const Candidate *same, *best;  ///< the effect itself as a candidate, and the best one; nullptr: none
    bool stays;                    ///< the effect as it is
  };
  InPlace best_in_place_of(std::size_t effect, const Evidence& evidence) const;
  bool check(std::size_t effect);
  bool find_evidence_beside_other_spring(std::size_t effect);

  Start& start_;
  const DiagnoseOptions& options_;
  Refusals refusals_;
  EvidenceKept evidence_;
  std::mutex present_asked_;
  std::shared_ptr<const Present> present_;  ///< of the model; nullptr: not asked for since it has changed
  std::vector<NotExplained> wrong_joints_;        ///< see check_joints()
  std::vector<Candidate> refused_;                ///< for good, without columns; springs are never made again: see Engine
  std::vector<std::string> notes_;
  int tried_{0};  ///< most candidates of a round, shapes counted
  bool exchanged_elsewhere_{false};  ///< a backward check has put an effect of another joint, or of the arm, in an effect's place
};

}  // namespace heft::diagnose
