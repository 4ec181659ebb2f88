#include "identified.hpp"

#include <cstddef>

namespace heft::diagnose {

int Identified::own_column(const Candidate& effect) const {
  if (effect.effect.is<Offset>()) return base->offset(effect.joint);
  return effect.effect.is<RotorInertia>() ? base->rotor(effect.joint) : -1;
}

std::unique_ptr<Engine> Identified::with_effects(const Engine& found, const std::vector<bool>& kept) const {
  auto engine = std::make_unique<Engine>(fit);
  engine->weights_held = found.weights_held;
  engine->masses_held = found.masses_held;
  for (std::size_t e = 0; e < found.accepted.size(); ++e) {
    const std::ptrdiff_t first = found.first_memory(e);
    if (const int column = own_column(found.accepted[e]); column >= 0) {
      if (kept[e]) continue;
      engine->left_out.resize(static_cast<std::size_t>(base->columns()), false);
      engine->left_out[static_cast<std::size_t>(column)] = true;
    } else if (kept[e] && (first < 0 || kept[static_cast<std::size_t>(first)])) {
      engine->accepted.push_back(found.accepted[e]);
      Candidate& effect = engine->accepted.back();
      if (effect.replaces >= 0) effect.replaces = base->coulomb(effect.joint);
    }
  }
  engine->begin_near(found, 2);
  return engine;
}

}  // namespace heft::diagnose
