/// @file
/// Tables and figures of the reproduction of Kawasaki and Nishimura (1984), open loop.
#pragma once

#include <cstddef>
#include <vector>

#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"
#include "terminal_link_study.hpp"

namespace heft::studies {

/// All estimators, in the order in which they are shown.
const std::vector<ProtocolMethod>& protocol_methods();
/// Numbers of samples at which every run was looked at.
std::vector<int> samples_of(const Study& study);

page::Table claim_table(const std::vector<Claim>& claims);
/// One base parameter against the number of samples: every seed lies in the band, the line is the mean.
page::PlotSpec parameter_plot(const Study& study, bool b, double period, std::size_t parameter, double unit,
                              const char* unit_name);
/// e against the number of samples, every method.
page::PlotSpec error_plot(const Study& study, bool b, double period);
page::Table instrument_table(const Study& study);
page::Table base_table(const Study& study);
/// What the production estimator hands out while data come in.
page::Table startup_table(const Study& study, bool b, bool fast);
page::Table mass_column_table(const MassColumnCheck& check);
page::Table uncorrected_rows_table(const UncorrectedRows& residual);
page::Table rank_table(const std::vector<RankCheck>& checks);
/// Every estimate of every run.
page::Table points_table(const Study& study);

}  // namespace heft::studies
