/// @file
/// Tables and figures of the reproduction of UPC-ETSEIB (2017).
#pragma once

#include <string>
#include <vector>

#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "ur5_stiffness_study.hpp"

namespace heft::studies {

/// A stiffness [N m/rad] in kN m/rad; ∞ and – where it is not finite.
std::string kilo(double value);
/// Value with its 95 % interval.
std::string interval(const stiffness::StiffnessEstimate& e);
/// A share with two digits.
std::string percent(double share);
/// A length in mm.
std::string millimetres(double metres, int digits = 3);
/// An id in words.
std::string effect_name(const std::string& id);
page::MapSpec dexterity_map_plot(const Ur5Study& study, bool sound);
page::PlotSpec pose_dexterity_plot(const DexterityStudy& dexterity);
page::Table stiffness_table(const StiffnessStudy& s);
page::Table fit_table(const StiffnessStudy& s);
page::Table direct_table(const stiffness::DirectStiffness& direct);
page::PlotSpec least_squares_plot(const StiffnessStudy& s);
page::PlotSpec readings_plot(const StiffnessStudy& s);
page::PlotSpec direct_plot(const stiffness::DirectStiffness& direct);
page::PlotSpec precision_plot(const SimulationStudy& simulation);
page::PlotSpec singles_plot(const SimulationStudy& simulation);
page::Table precision_table(const SimulationStudy& simulation);
std::vector<page::PlotSpec> ellipse_plots(const StiffnessStudy& s);
page::Table trial_table(const stiffness::StiffnessDiagnosis& d, const std::vector<std::string>& unseen);
page::Table correlation_table(const stiffness::StiffnessDiagnosis& tool,
                              const stiffness::StiffnessDiagnosis& both);
page::Table power_table(const SimulationStudy& simulation);
page::Table plan_table(const SimulationStudy& simulation);

}  // namespace heft::studies
