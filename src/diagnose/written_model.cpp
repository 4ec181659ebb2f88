#include "written_model.hpp"

#include <utility>

namespace heft::diagnose {

using Eigen::VectorXd;

WrittenModel::WrittenModel(const Search& search, std::shared_ptr<const BaseModel> base)
    : search_(search), base_(std::move(base)), engine_(built(-1, 0.0)) {}

int WrittenModel::own_column(std::size_t effect) const {
  const Candidate& e = search_.engine().accepted[effect];
  if (e.effect.is<Offset>()) return base_->offset(e.joint);
  return e.effect.is<RotorInertia>() ? base_->rotor(e.joint) : -1;
}

std::unique_ptr<Engine> WrittenModel::built(std::ptrdiff_t without, double steady) const {
  const Engine& found = search_.engine();
  const Start& start = search_.start();
  auto engine = std::make_unique<Engine>(base_, start.train->shared_table(), start.pairs, steady);
  engine->weights_held = found.weights_held;
  engine->masses_held = found.masses_held;
  for (std::size_t e = 0; e < found.accepted.size(); ++e) {
    const auto own = static_cast<std::ptrdiff_t>(e);
    if (const int column = own_column(e); column >= 0) {
      if (own != without) continue;
      engine->left_out.assign(static_cast<std::size_t>(base_->columns()), false);
      engine->left_out[static_cast<std::size_t>(column)] = true;
    } else if (own != without && (without < 0 || found.first_memory(e) != without)) {
      engine->accepted.push_back(found.accepted[e]);
      Candidate& effect = engine->accepted.back();
      if (effect.replaces >= 0) effect.replaces = base_->coulomb(effect.joint);
    }
  }
  engine->build();
  return engine;
}

std::unique_ptr<Engine> WrittenModel::without(std::size_t effect) const {
  return built(static_cast<std::ptrdiff_t>(effect), engine_->steady());
}

VectorXd WrittenModel::coefficients(std::size_t effect) const {
  if (const int column = own_column(effect); column >= 0)
    return engine_->problem().theta().segment(column, 1);
  std::size_t place = 0;
  for (std::size_t e = 0; e < effect; ++e) place += own_column(e) < 0 ? 1 : 0;
  return engine_->coefficients(place);
}

}  // namespace heft::diagnose
