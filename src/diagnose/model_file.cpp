#include "heft/model/model_file.hpp"

#include <limits>

#include "heft/diagnose/diagnose.hpp"
#include "heft/model/physical_links.hpp"

namespace heft::diagnose {

model::ModelFile Diagnosis::model_file() const {
  model::ModelFile file = model::make_model(written());
  model::FitRecord fit = refitted ? refitted->parameters : parameters;
  fit.method = "diagnose";
  fit.torque_at = joint_sensor ? "joint" : "motor";
  fit.condition_number = std::numeric_limits<double>::quiet_NaN();
  fit.physically_consistent = model::is_physically_consistent(written());
  validate::put_training(train_after, fit);
  fit.samples = train_after.samples;
  if (!ordinary_motion) {
    fit.cutoff_hz = cutoff;
    fit.sign_width = sign_width;
  }
  file.fit = fit;
  file.provenance.method = "diagnose";
  for (const Traces& log : train) file.provenance.logs.push_back(log.log);
  for (const Traces& log : validate) {
    if (refitted) file.provenance.logs.push_back(log.log);
  }
  return file;
}

}  // namespace heft::diagnose
