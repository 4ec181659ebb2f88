/// @file
/// One self-contained HTML page: no outside file, readable in the dark, on paper and without scripts. Where scripts run, plots
/// tell their values and can be enlarged, tables sort, and data can be saved.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "heft/host/verdict.hpp"
#include "heft/page/plot.hpp"
#include "heft/page/table.hpp"

namespace heft::page {

/// A number worth a tile of its own at the top of a page.
struct Fact {
  std::string label;  ///< "mass found"
  std::string value;  ///< "2.81 kg"
  std::string note;   ///< "± 0.03, true 2.805"; may be empty
};

/// Columns of numbers that a reader can save as CSV; without scripts nothing of it shows.
/// In the page a value takes three characters, the first column's four: it is exact to 1/2^18 of what its column spans,
/// the first column's (time) to 1/2^24. Thousands of rows make a page large: thin them first, and say so in the notes.
struct DataFile {
  struct Column {
    std::string name;            ///< "time", "residual1"
    std::vector<double> values;  ///< NaN: an empty cell
  };
  std::string label;  ///< of the link: "Save the residuals as CSV"
  std::string name;   ///< "residuals-run-a.csv"
  std::vector<std::string>
      notes{};                    ///< lines after "# " at the top of the file: what it holds, units, thinning
  std::vector<Column> columns{};  ///< of the same length
};

/// How a verdict is tinted: green, blue (nothing is judged), amber, red.
enum class Tone { kGood, kNeutral, kDoubtful, kBad };
Tone tone_of(host::Verdict verdict);

/// Collects the parts of a page in order and writes it. All text is plain and is escaped here.
///
/// @code
/// Page report("Payload");
/// report.verdict("The load weighs 2.81 kg ± 0.03 kg.", validate::judge(run));
/// report.plot({"Mass", "time [s]", "mass [kg]", {line("estimate", time, mass)}});
/// report.write("payload.html");
/// @endcode
class Page {
 public:
  explicit Page(std::string title, std::string subtitle = {});

  /// The answer in one sentence, shown under the title.
  Page& verdict(const std::string& sentence, Tone tone = Tone::kNeutral);
  /// The same in the tone that the judgement has earned, its reasons below the sentence.
  Page& verdict(const std::string& sentence, const host::Judgement& judgement);
  Page& facts(const std::vector<Fact>& facts);
  Page& heading(const std::string& text);
  Page& paragraph(const std::string& text);
  /// A smaller, set-off paragraph: definitions, limits, what contradicts expectation.
  Page& note(const std::string& text);
  Page& preformatted(const std::string& text);
  Page& table(const Table& table, const std::string& caption = {});
  Page& plot(const PlotSpec& spec);
  Page& plot(const MapSpec& spec);
  /// Small multiples (one plot a joint) with one legend, that of the first plot.
  Page& plots(const std::string& title, std::vector<PlotSpec> specs);

  /// A link that saves the data; none where there are no rows.
  Page& file(const DataFile& file);

  /// A line at the very end: the command, the date, the sample rate and length of a log.
  Page& footer(const std::string& line);

  /// The whole page. Cost: one gnuplot process a plot.
  std::string html() const;
  /// Writes the page; it appears whole or not at all.
  /// @throws InputError when the folder does not exist or cannot be written.
  void write(const std::string& path) const;

 private:
  /// Finished HTML, or a plot that html() draws: a report that is never written costs no drawing.
  struct Part {
    std::string html;
    std::function<std::string()> drawing{};
  };
  void add_figure(PlotSpec spec, bool with_legend);

  std::string title_;
  std::string subtitle_;
  std::vector<Part> parts_;
  std::vector<std::string> footer_;
};

/// Text safe inside HTML elements and quoted attributes.
std::string escape_html(const std::string& text);

}  // namespace heft::page
