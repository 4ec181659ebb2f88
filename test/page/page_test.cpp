/// The report room: tables, plots and pages.
#include "heft/page/page.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <regex>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "compact_svg.hpp"
#include "heft/host/file.hpp"
#include "level_outline.hpp"
#include "support/temporary_folder.hpp"

namespace heft::page {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

bool gnuplot_is_installed() { return std::system("command -v gnuplot >/dev/null 2>&1") == 0; }
#define NEEDS_GNUPLOT() \
  if (!gnuplot_is_installed()) GTEST_SKIP() << "gnuplot is not installed"

/// A path without programs, for as long as it lives.
class WithoutPrograms {
 public:
  WithoutPrograms() : path_(std::getenv("PATH")) { ::setenv("PATH", "/nonexistent", 1); }
  ~WithoutPrograms() { ::setenv("PATH", path_.c_str(), 1); }

 private:
  std::string path_;
};

PlotSpec small_plot() { return {"Sine", "time [s]", "value", {{"a curve", {0, 1, 2, 3}, {0, 1, 0, -1}}}}; }

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t number = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++number;
  return number;
}

TEST(Table, AlignsNumbersRightAndTextLeft) {
  Table table({"joint", "RMSE [N·m]", "remark"});
  table.add_row({"1", "12.5", "fine"}).add_row({"10", "–", ""});
  EXPECT_EQ(table.to_text(2),
            "  joint  RMSE [N·m]  remark\n"
            "  ─────  ──────────  ──────\n"
            "      1        12.5  fine\n"
            "     10           –\n");
}

TEST(Table, CountsLettersNotBytes) {
  EXPECT_EQ(display_width("N·m"), 3U);
  EXPECT_EQ(display_width("kg·m²"), 5U);
  EXPECT_EQ(display_width("q\u0307"), 1U);  // a combining dot takes no column
}

TEST(Table, ShortRowsAreFilledAndLongOnesCut) {
  Table table({"a", "b"});
  table.add_row({"1"}).add_row({"1", "2", "3"});
  EXPECT_EQ(table.rows()[0].size(), 2U);
  EXPECT_EQ(table.rows()[1].size(), 2U);
}

TEST(Number, KeepsTheSignificantDigits) {
  EXPECT_EQ(number(0.0), "0");
  EXPECT_EQ(number(2.80512), "2.805");
  EXPECT_EQ(number(123456.0), "123456");
  EXPECT_EQ(number(-0.001234567), "-0.001235");
  EXPECT_EQ(number(1.5e-9), "1.500e-09");
  EXPECT_EQ(number(std::numeric_limits<double>::quiet_NaN()), "–");
}

/// Every kind of part.
Page whole_page() {
  Page page("Title", "subtitle");
  page.verdict("It works.", Tone::kGood).facts({{"mass", "1 kg", ""}}).heading("h").paragraph("p").note("n");
  page.preformatted("x")
      .table(Table({"a"}).add_row({"1"}))
      .plot(small_plot())
      .plots("all", {small_plot(), small_plot()})
      .file({"Save it", "it.csv", {"one of </script>"}, {{"time", {0, 1}}, {"value", {2, 3}}}});
  return page;
}

TEST(Page, HasNoOutsideReference) {
  NEEDS_GNUPLOT();
  const std::string html = whole_page().html();
  EXPECT_THAT(html, HasSubstr("<svg"));
  for (const char* outside :
       {"http:", "https:", "src=", "<link", "@import", "url(", "xlink", "file:", "fetch(", "import("}) {
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  }
  EXPECT_THAT(html, HasSubstr("Content-Security-Policy\" content=\"default-src 'none';"));
}

TEST(Page, IsWholeWithoutItsScript) {
  NEEDS_GNUPLOT();
  const std::string html = whole_page().html();
  // One program at the very end, and data that shows nothing: taken away, all that a reader sees is there.
  EXPECT_EQ(count(html, "<script>"), 1U);
  EXPECT_EQ(count(html, "<script"), 2U);
  EXPECT_EQ(count(html, "</script>"), 2U) << "a note must not end the element";
  EXPECT_GT(html.find("<script>"), html.find("</main>"));
  EXPECT_EQ(count(html, "<svg viewBox"), 3U);
  EXPECT_EQ(count(html, "<button"), 0U) << "the script adds what it answers to";
  EXPECT_THAT(html, HasSubstr("@media print{.controls,.cross{display:none}"));
}

TEST(Page, CarriesTheScriptOfWhatItHolds) {
  NEEDS_GNUPLOT();
  const std::string text = Page("Page").paragraph("p").html();
  EXPECT_THAT(text, Not(HasSubstr("<script")));
  const std::string table = Page("Page").table(Table({"a"}).add_row({"1"})).html();
  EXPECT_THAT(table, HasSubstr("aria-sort"));
  EXPECT_THAT(table, Not(HasSubstr("class Plot")));
  EXPECT_THAT(Page("Page").plot(small_plot()).html(), HasSubstr("class Plot"));
  EXPECT_LT(table.size(), 9'000U);
}

/// What a reader's program makes of a drawing: each series' points [value], by the drawing and its `data-plot` alone.
struct ReadPlot {
  nlohmann::json data;
  std::vector<std::vector<std::pair<double, double>>> series;
  double x_resolution{0.0},
      y_resolution{0.0};  ///< of a tenth of a pixel; on a logarithmic axis of its logarithm
};

/// Value at a pixel, the logarithm of it on a logarithmic axis.
double along(const nlohmann::json& axis, double pixel) {
  double low = axis["range"][0], high = axis["range"][1];
  if (axis["log"]) low = std::log(low), high = std::log(high);
  const double from = axis["pixels"][0], to = axis["pixels"][1];
  return low + (high - low) * (pixel - from) / (to - from);
}

ReadPlot read_plot(const PlotSpec& spec) {
  const std::string html = render_plot(spec);
  std::smatch found;
  ReadPlot plot;
  if (!std::regex_search(html, found, std::regex("data-plot='([^']*)'"))) return plot;
  plot.data = nlohmann::json::parse(found[1].str());
  plot.x_resolution = std::abs(along(plot.data["x"], 0.1) - along(plot.data["x"], 0.0));
  plot.y_resolution = std::abs(along(plot.data["y"], 0.1) - along(plot.data["y"], 0.0));
  const std::regex number("(-?[0-9.]+),(-?[0-9.]+)");
  for (std::size_t k = 0; k < spec.series.size(); ++k) {
    const std::size_t begin = html.find("<g class=\"series\" data-i=\"" + std::to_string(k) + "\">");
    if (begin == std::string::npos) break;
    const std::string group = html.substr(begin, html.find("<g class=\"series\"", begin + 1) - begin);
    const std::size_t path = group.find_first_of(
        '\'', group.find(" d=") != std::string::npos ? group.find(" d=") : group.find("points ="));
    const std::string points = group.substr(path + 1, group.find('\'', path + 1) - path - 1);
    plot.series.emplace_back();
    for (std::sregex_iterator i(points.begin(), points.end(), number), end; i != end; ++i) {
      plot.series.back().emplace_back(along(plot.data["x"], std::stod((*i)[1])),
                                      along(plot.data["y"], std::stod((*i)[2])));
    }
  }
  return plot;
}

TEST(Plot, ValuesAreReadFromTheDrawingAsTheyWereGiven) {
  NEEDS_GNUPLOT();
  const Series curve{"curve", {1, 2, 4, 8.5, 9}, {3, -1, 0.5, 7, 2}};
  PlotSpec plain{"Plain", "time [s]", "torque [N·m]", {curve, {"dots", {2, 3}, {1, 4}, {}, Style::kDots}}};
  PlotSpec logarithmic{"Log", "f [Hz]", "a", {{"a", {1, 10, 500}, {1e-6, 2e-3, 40}}}};
  logarithmic.log_x = logarithmic.log_y = true;
  PlotSpec square{"Square", "x [m]", "y [m]", {{"shape", {-3, 0, 3, 0, -3}, {0, 1, 0, -1, 0}}}};
  square.equal_axes = true;
  PlotSpec small = plain;
  small.width = 460;
  small.height = 210;
  small.y_range = {-2.0, 8.0};
  const double epoch = 1.7e9;  // time stamps of a clock
  PlotSpec late{"Late", "time [s]", "", {{"", {epoch, epoch + 0.25, epoch + 1.0}, {0, 1, 2}}}};
  int points = 0;
  for (const PlotSpec& spec : {plain, logarithmic, square, small, late}) {
    const ReadPlot plot = read_plot(spec);
    ASSERT_EQ(plot.series.size(), spec.series.size()) << spec.title;
    EXPECT_EQ(plot.data["x"]["label"], spec.x_label);
    for (std::size_t k = 0; k < spec.series.size(); ++k) {
      const Series& series = spec.series[k];
      EXPECT_EQ(plot.data["series"][k]["label"], series.label);
      ASSERT_EQ(plot.series[k].size(), series.x.size()) << spec.title;
      for (std::size_t i = 0; i < series.x.size(); ++i, ++points) {
        // gnuplot rounds to a hundredth of a pixel, and the page cuts off what is below a tenth.
        EXPECT_NEAR(plot.series[k][i].first, spec.log_x ? std::log(series.x[i]) : series.x[i],
                    1.2 * plot.x_resolution)
            << spec.title;
        EXPECT_NEAR(plot.series[k][i].second, spec.log_y ? std::log(series.y[i]) : series.y[i],
                    1.2 * plot.y_resolution)
            << spec.title;
      }
      EXPECT_LT(plot.y_resolution, spec.log_y ? 0.02 : 0.02) << "a tenth of a pixel is next to nothing";
    }
  }
  EXPECT_EQ(points, 7 + 3 + 5 + 7 + 3);
}

TEST(Plot, BarsAndMarksAreNamedInItsData) {
  NEEDS_GNUPLOT();
  PlotSpec spec{"Bars", "", "RMSE [%]", {bars("it's", {1, 3}), bars("b", {2, 5})}};
  spec.categories = {"joint 1", "joint <2>"};
  spec.marks.push_back({Mark::Direction::kHorizontal, 4.0, "limit"});
  const ReadPlot plot = read_plot([&] {
    PlotSpec plain = spec;
    plain.series[0].label = "its";  // an escaped apostrophe is not JSON yet
    plain.categories[1] = "joint 2";
    return plain;
  }());
  EXPECT_EQ(plot.data["categories"], nlohmann::json({"joint 1", "joint 2"}));
  EXPECT_EQ(plot.data["marks"], nlohmann::json::parse(R"([{"y": 4.0, "label": "limit"}])"));
  EXPECT_EQ(plot.data["series"][1]["style"], "bars");
  ASSERT_EQ(plot.series.size(), 2U);
  double top = 0.0;
  for (const auto& [x, y] : plot.series[0]) top = std::max(top, y);
  EXPECT_NEAR(top, 1.0, 1.2 * plot.y_resolution) << "the first bar of the first series";
  const std::string html = render_plot(spec);
  EXPECT_THAT(html, HasSubstr("it&#39;s"));
  EXPECT_THAT(html, HasSubstr("joint &lt;2>"));
}

TEST(Page, CarriesAFileToWithinItsDigits) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> time, value, constant;
  for (int k = 0; k < 1500; ++k) {
    time.push_back(1.7e9 + 0.002 * k + 1e-5 * (k % 7));
    value.push_back(k == 3 ? nan : 12.0 * std::sin(0.01 * k) + 1e-3 * k);
    constant.push_back(-2.5);
  }
  const std::string html =
      Page("Page")
          .file({"Save", "a.csv", {"note"}, {{"time", time}, {"value", value}, {"constant", constant}}})
          .html();
  const std::string open = "<script class=\"file\" type=\"application/json\">";
  const std::size_t begin = html.find(open) + open.size();
  const nlohmann::json file =
      nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
  EXPECT_EQ(file["notes"], nlohmann::json({"note"}));
  ASSERT_EQ(file["columns"].size(), 3U);
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::vector<const std::vector<double>*> given{&time, &value, &constant};
  for (std::size_t c = 0; c < 3; ++c) {
    const nlohmann::json& column = file["columns"][c];
    const std::string data = column["data"];
    const std::size_t places = column["places"];
    ASSERT_EQ(data.size(), 1500 * places);
    for (std::size_t k = 0; k < 1500; ++k) {
      std::size_t n = 0;
      for (std::size_t i = 0; i < places; ++i) n = 64 * n + alphabet.find(data[places * k + i]);
      if (std::isnan((*given[c])[k])) {
        EXPECT_EQ(n + 1, std::size_t{1} << (6 * places));
        continue;
      }
      const double step = column["step"], found = column["low"].get<double>() + step * static_cast<double>(n);
      ASSERT_NEAR(found, (*given[c])[k], 0.51 * step + 3e-7)
          << c << " " << k;  // of 1.7e9 a double knows 2e-7
    }
  }
  EXPECT_LT(file["columns"][0]["step"], 1e-6) << "seconds";
  EXPECT_THAT(Page("Page").file({"Save", "a.csv", {}, {{"time", {}}}}).html(), Not(HasSubstr("<script")));
}

TEST(Page, TakesTheToneOfItsVerdictFromTheJudgement) {
  EXPECT_EQ(tone_of(host::Verdict::kGood), Tone::kGood);
  EXPECT_EQ(tone_of(host::Verdict::kDoubtful), Tone::kDoubtful);
  EXPECT_EQ(tone_of(host::Verdict::kBad), Tone::kBad);
  host::Judgement judgement;
  EXPECT_THAT(Page("Page").verdict("Done.", judgement).html(),
              HasSubstr("<p class=\"verdict good\">Done.</p>"));
  judgement.add(host::Verdict::kDoubtful, "one is <open>");
  EXPECT_THAT(Page("Page").verdict("Done.", judgement).html(),
              HasSubstr("<div class=\"verdict doubtful\">Done.<strong>Doubtful, because:</strong><ul>\n"
                        "<li>one is &lt;open&gt;</li>"));
  judgement.add(host::Verdict::kBad, "the worst");
  const std::string bad = Page("Page").verdict("Done.", judgement).html();
  EXPECT_THAT(bad, HasSubstr("<div class=\"verdict bad\">"));
  EXPECT_LT(bad.find("the worst"), bad.find("one is")) << "the worst reason first";
}

TEST(Page, EndsWithHowItCameToBe) {
  const std::string html = Page("Page").footer("heft identify --log <a>.csv").html();
  EXPECT_GT(html.find("<p>heft identify --log &lt;a&gt;.csv</p>"), html.find("<footer>"));
}

TEST(Page, EscapesTextEverywhere) {
  const std::string evil = "<b>\"Tom\" & 'Jerry'</b>";
  PlotSpec spec = small_plot();
  spec.title = spec.x_label = spec.y_label = spec.series[0].label = evil;
  spec.marks.push_back({Mark::Direction::kVertical, 1.0, evil});
  Page page(evil, evil);
  page.verdict(evil).facts({{evil, evil, evil}}).heading(evil).paragraph(evil).note(evil).preformatted(evil);
  page.table(Table({evil}).add_row({evil}), evil).plot(spec).plots(evil, {spec});
  EXPECT_THAT(page.html(), Not(HasSubstr("<b>\"")));
  EXPECT_THAT(page.html(), Not(HasSubstr("Jerry'</b>")));
  EXPECT_THAT(page.html(), HasSubstr("&lt;b&gt;&quot;Tom&quot; &amp; &#39;Jerry&#39;&lt;/b&gt;"));
}

TEST(Page, LabelsAreNotRunByGnuplot) {
  NEEDS_GNUPLOT();
  const test::TemporaryFolder folder;
  const std::string trace = folder.path("trace");
  PlotSpec spec = small_plot();
  spec.x_label = "`touch " + trace + "`";
  spec.series[0].label = "'; system('touch " + trace + "'); '";
  spec.y_label = "two\nlines";
  EXPECT_THAT(render_plot(spec), HasSubstr("<svg"));
  EXPECT_EQ(folder.num_entries(), 0U);
}

TEST(Page, IsWrittenWhole) {
  const test::TemporaryFolder folder;
  Page("Page").verdict("Done.").write(folder.path("page.html"));
  EXPECT_THAT(host::read_file(folder.path("page.html"), "report"), HasSubstr("</html>"));
  EXPECT_EQ(folder.num_entries(), 1U);
}

TEST(Page, SmallMultiplesShareOneLegend) {
  Page page("Page");
  page.plots("all", {small_plot(), small_plot(), small_plot()});
  EXPECT_EQ(count(page.html(), "a curve</span>"), 1U);
}

TEST(Page, SaysWhenGnuplotIsMissing) {
  const WithoutPrograms nothing;
  const std::string html = render_plot(small_plot());
  EXPECT_THAT(html, HasSubstr("gnuplot was not found"));
  EXPECT_THAT(html, HasSubstr("Sine"));
  const test::TemporaryFolder folder;
  EXPECT_FALSE(write_svg(small_plot(), folder.path("plot.svg")));
  EXPECT_EQ(folder.num_entries(), 0U);
}

TEST(Plot, SaysWhenThereIsNothingToDraw) {
  PlotSpec spec = small_plot();
  for (double& y : spec.series[0].y) y = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(render_plot(spec), HasSubstr("no finite value"));
  spec.series.clear();
  EXPECT_THAT(render_plot(spec), HasSubstr("no finite value"));
}

TEST(Plot, DrawsConstantsSinglePointsAndGaps) {
  NEEDS_GNUPLOT();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Series& series : {Series{"constant", {0, 1, 2}, {5, 5, 5}}, Series{"zero", {0, 1}, {0, 0}},
                               Series{"point", {1}, {1}}, Series{"gap", {0, 1, 2, 3, 4}, {1, 2, nan, 1, 2}},
                               Series{"steps", {0, 1, 2}, {1, 2, 3}, {}, Style::kSteps},
                               Series{"band", {0, 1, 2}, {1, 1, 1}, {2, nan, 2}, Style::kBand}}) {
    PlotSpec spec{"Edge", "x", "y", {series}};
    EXPECT_THAT(render_plot(spec), HasSubstr("<svg")) << series.label;
  }
}

TEST(Plot, AMillionPointsStaySmall) {
  NEEDS_GNUPLOT();
  constexpr int kPoints = 1'000'000;
  std::mt19937 generator(7);
  std::normal_distribution<double> noise;
  Series series{"noise", std::vector<double>(kPoints), std::vector<double>(kPoints)};
  for (std::size_t k = 0; k < kPoints; ++k) {
    series.x[k] = 1e-3 * static_cast<double>(k);
    series.y[k] = noise(generator);
  }
  const std::string svg = render_plot({"Noise", "time [s]", "y", {series}});
  EXPECT_THAT(svg, HasSubstr("<svg"));
  EXPECT_LT(svg.size(), 60'000U);

  // A cloud of points everywhere becomes a picture instead of a huge drawing.
  for (std::size_t k = 0; k < kPoints; ++k) series.x[k] = noise(generator);
  series.style = Style::kPoints;
  const std::string cloud = render_plot({"Cloud", "x", "y", {series}});
  EXPECT_THAT(cloud, HasSubstr("data:image/png;base64,iVBORw0KGgo"));
  EXPECT_LT(cloud.size(), 600'000U);
}

TEST(Plot, ThinningKeepsEveryExtreme) {
  constexpr std::size_t kPoints = 100'000;
  Series series{"", std::vector<double>(kPoints), std::vector<double>(kPoints, 0.0)};
  for (std::size_t k = 0; k < kPoints; ++k) series.x[k] = static_cast<double>(k);
  series.y[12'345] = 7.0;  // a spike one sample wide
  series.y[77'777] = -9.0;
  const Series thin = decimate(series, 900, 300);
  EXPECT_LE(thin.x.size(), 1800U);
  EXPECT_EQ(*std::max_element(thin.y.begin(), thin.y.end()), 7.0);
  EXPECT_EQ(*std::min_element(thin.y.begin(), thin.y.end()), -9.0);
  const auto at = static_cast<std::size_t>(std::max_element(thin.y.begin(), thin.y.end()) - thin.y.begin());
  EXPECT_EQ(thin.x[at], 12'345.0);
  EXPECT_TRUE(std::is_sorted(thin.x.begin(), thin.x.end()));
}

TEST(Plot, ThinningLeavesShortSeriesAlone) {
  const Series series{"", {0, 1, 2}, {3, 4, 5}};
  const Series thin = decimate(series, 900, 300);
  EXPECT_EQ(thin.x, series.x);
  EXPECT_EQ(thin.y, series.y);
}

TEST(Plot, NothingBelowZeroOnALogAxis) {
  NEEDS_GNUPLOT();
  PlotSpec spec{"Log", "x", "y", {{"", {1, 2, 3, 4}, {1, 0, -5, 100}}}};
  spec.log_y = true;
  EXPECT_THAT(render_plot(spec), HasSubstr("<svg"));
}

TEST(Plot, DrawsIntervalsDotsAndShapes) {
  NEEDS_GNUPLOT();
  PlotSpec spec{"Intervals", "", "y", {}};
  spec.categories = {"one", "two"};
  spec.series = {{"interval", {0, 1}, {1, 2}, {3, 5}, Style::kIntervals},
                 {"dots", {0, 1}, {2, 3}, {}, Style::kDots}};
  const std::string svg = render_plot(spec);
  EXPECT_THAT(svg, HasSubstr("two"));
  EXPECT_THAT(svg, HasSubstr("stroke-width='7.8'"));  // dots are larger than points
  EXPECT_THAT(legend_html(spec), HasSubstr("class=\"dot\""));
  PlotSpec shape{"Circle", "x", "y", {{"", {-3, 0, 3, 0, -3}, {0, 3, 0, -3, 0}}}};
  shape.equal_axes = true;
  EXPECT_THAT(render_plot(shape), HasSubstr("<svg"));
}

MapSpec small_map() {
  MapSpec map;
  map.title = "Rings";
  map.x_label = "x";
  map.y_label = "y";
  map.value_label = "value";
  for (int k = 0; k <= 60; ++k) map.x.push_back(-3.0 + 0.1 * k);
  map.y = map.x;
  map.values.resize(61, 61);
  for (Eigen::Index i = 0; i < 61; ++i) {
    for (Eigen::Index j = 0; j < 61; ++j) {
      const double r = std::hypot(map.x[static_cast<std::size_t>(i)], map.y[static_cast<std::size_t>(j)]);
      map.values(i, j) = 1.0 - std::abs(r - 1.5);  // above 0.5 between the circles of 1 and 2
    }
  }
  map.levels = {0.5};
  return map;
}

/// Against the clock positive.
double area(const std::vector<Outline>& outlines) {
  double sum = 0.0;
  for (const Outline& o : outlines) {
    for (std::size_t k = 0; k < o.size(); ++k) {
      const auto& a = o[k];
      const auto& b = o[(k + 1) % o.size()];
      sum += 0.5 * (a[0] * b[1] - a[1] * b[0]);
    }
  }
  return sum;
}

TEST(Map, OutlinesEncloseTheRegionWithoutItsHoles) {
  const MapSpec map = small_map();
  const std::vector<Outline> ring = level_outlines(map.x, map.y, map.values, 0.5);
  EXPECT_EQ(ring.size(), 2U);
  EXPECT_NEAR(area(ring), 3.14159265 * (2.0 * 2.0 - 1.0), 0.02);
}

TEST(Map, OutlinesFollowTheBorder) {
  const MapSpec map = small_map();
  // All but a disc of radius 1.5: out to the corners.
  Eigen::MatrixXd far(61, 61);
  for (Eigen::Index i = 0; i < 61; ++i) {
    for (Eigen::Index j = 0; j < 61; ++j) {
      far(i, j) = std::hypot(map.x[static_cast<std::size_t>(i)], map.y[static_cast<std::size_t>(j)]);
    }
  }
  EXPECT_NEAR(area(level_outlines(map.x, map.y, far, 1.5)), 36.0 - 3.14159265 * 2.25, 0.02);
  EXPECT_NEAR(area(level_outlines(map.x, map.y, far, -1.0)), 36.0, 1e-9);
  EXPECT_TRUE(level_outlines(map.x, map.y, far, 9.0).empty());
  far.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(level_outlines(map.x, map.y, far, 0.0).empty());
}

TEST(Map, DrawsLevelsFramesAndPlaces) {
  NEEDS_GNUPLOT();
  MapSpec map = small_map();
  map.frames = {{-2, 2, -2, 2, "zone A", true}};
  map.places = {{0, 0, "7"}};
  const std::string svg = render_plot(map);
  for (const char* part : {"<svg", "zone A", ">7<", "0.5", "<polygon"}) EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_THAT(svg, Not(HasSubstr("crispEdges")));
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_svg(map, folder.path("map.svg")));
  EXPECT_THAT(host::read_file(folder.path("map.svg"), "drawing"), HasSubstr("Rings"));
  EXPECT_THAT(Page("Page").plot(map).html(), HasSubstr("<polygon"));
}

TEST(Map, SaysWhenThereIsNothingToDraw) {
  MapSpec map = small_map();
  map.y.pop_back();
  EXPECT_THAT(render_plot(map), HasSubstr("nothing to draw"));
  const WithoutPrograms nothing;
  EXPECT_THAT(render_plot(small_map()), HasSubstr("gnuplot was not found"));
}

TEST(Plot, StandaloneDrawingCarriesTitleAndLegend) {
  NEEDS_GNUPLOT();
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_svg(small_plot(), folder.path("plot.svg")));
  const std::string svg = host::read_file(folder.path("plot.svg"), "drawing");
  EXPECT_THAT(svg, HasSubstr("xmlns=\"http://www.w3.org/2000/svg\""));
  EXPECT_THAT(svg, HasSubstr("Sine"));
  EXPECT_THAT(svg, HasSubstr("a curve"));
}

TEST(Drawing, GoesOnWithAGroupOfTheSameStyleAlone) {
  const auto group = [](const char* width, const char* content) {
    return fmt::format("<g fill=\"none\" color=\"black\" stroke-width=\"{}\">\n{}</g>\n", width, content);
  };
  const std::string svg = "<g id=\"gnuplot_canvas\">\n" + group("1.00", "<path d='M1.00,1.00'/>") +
                          group("2.00", "") + group("1.00", "<g>\n<text>a</text>\n</g>\n") +
                          group("1.60", "<path d='M2.00,2.00'/>") + "</g>\n</svg>\n";
  EXPECT_EQ(
      compact_svg(svg),
      "<g>\n<g fill=\"none\" color=\"var(--ink,#24292f)\" stroke-width=\"1.00\">\n<path d='M1.0,1.0'/>"
      "<g>\n<text>a</text>\n</g>\n</g>\n"
      "<g fill=\"none\" color=\"var(--ink,#24292f)\" stroke-width=\"1.60\">\n<path d='M2.0,2.0'/></g>\n</g>\n");
}

}  // namespace
}  // namespace heft::page
