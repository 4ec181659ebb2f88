/// The report room: tables, plots and pages.
#include "heft/page/page.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(Page, HasNoOutsideReferenceAndNoScript) {
  NEEDS_GNUPLOT();
  Page page("Title", "subtitle");
  page.verdict("It works.", Tone::kGood).facts({{"mass", "1 kg", ""}}).heading("h").paragraph("p").note("n");
  page.preformatted("x")
      .table(Table({"a"}).add_row({"1"}))
      .plot(small_plot())
      .plots("all", {small_plot(), small_plot()});
  const std::string html = page.html();
  EXPECT_THAT(html, HasSubstr("<svg"));
  for (const char* outside :
       {"http:", "https:", "src=\"/", "<link", "<script", "@import", "url(", "xlink", "file:"}) {
    EXPECT_THAT(html, Not(HasSubstr(outside)));
  }
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

}  // namespace
}  // namespace heft::page
