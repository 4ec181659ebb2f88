/// @file
/// Plots for reports, drawn by gnuplot as inline SVG.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace heft::page {

/// Colours that people with any colour vision can distinguish, on light and dark ground and in print.
/// kAuto gives each series the next one.
enum class Hue { kAuto, kNeutral, kBlue, kVermillion, kGreen, kPurple, kSky, kOrange };

/// How a series is drawn.
enum class Style {
  kLine,
  kDashed,
  kSteps,  ///< held until the next sample
  kPoints,
  kDots,       ///< points that are few and large
  kIntervals,  ///< an upright line from `y` to `y_high` at each x
  kBand,       ///< filled between `y` and `y_high`
  kBars        ///< one bar a category; several such series are drawn side by side
};

/// One curve. x and y have the same length; NaN leaves a gap.
struct Series {
  std::string label;  ///< in the legend; empty leaves it out
  std::vector<double> x;
  std::vector<double> y;
  std::vector<double> y_high{};  ///< upper edge of a band, upper end of an interval
  Style style{Style::kLine};
  Hue hue{Hue::kAuto};
};

/// Series from Eigen columns.
Series line(std::string label, const Eigen::VectorXd& x, const Eigen::VectorXd& y, Hue hue = Hue::kAuto);
Series band(std::string label, const Eigen::VectorXd& x, const Eigen::VectorXd& low,
            const Eigen::VectorXd& high, Hue hue = Hue::kAuto);
/// Bars over PlotSpec::categories.
Series bars(std::string label, std::vector<double> heights, Hue hue = Hue::kAuto);

/// A dashed line across the plot with a short text, for events and true values.
struct Mark {
  enum class Direction { kVertical, kHorizontal };
  Direction direction{Direction::kVertical};
  double at{0.0};
  std::string label;
};

/// What to draw. Labels carry the unit: `"torque [N·m]"`.
struct PlotSpec {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<Series> series;
  std::vector<Mark> marks{};
  std::vector<std::string> categories{};  ///< names along x, at x = 0, 1, 2...; bars need them
  bool log_x{false};
  bool log_y{false};
  bool equal_axes{false};                              ///< one unit is as long in both directions, for shapes
  std::optional<std::pair<double, double>> y_range{};  ///< else fitted to the data
  int width{920};                                      ///< [px]; the drawing scales with the page
  int height{300};
};

/// A quantity over two axes, as levels filled with colours of evenly growing lightness.
struct MapSpec {
  /// A rectangle with a short text in its upper left corner.
  struct Frame {
    double x_low{0.0}, x_high{0.0}, y_low{0.0}, y_high{0.0};
    std::string label{};
    bool dashed{false};
  };
  /// A place with a name of one or two letters.
  struct Place {
    double x{0.0}, y{0.0};
    std::string label;
  };

  std::string title;
  std::string x_label;
  std::string y_label;
  std::string value_label;     ///< over the key of colours
  std::vector<double> x, y;    ///< of the grid, ascending
  Eigen::MatrixXd values;      ///< x.size() × y.size(); NaN is left in the colour below the first level
  std::vector<double> levels;  ///< ascending, borders between colours
  std::vector<Frame> frames{};
  std::vector<Place> places{};
  double x_tics{0.0}, y_tics{0.0};  ///< distance of the numbers along the axes; 0: chosen
  int width{920};                   ///< [px]
  int height{420};
};

/// The drawing as an HTML fragment: an inline `<svg>` without outside references; a base64 PNG when the SVG
/// would pass 300 KB; a sentence saying what is wrong when gnuplot is missing or fails. Never throws for
/// either. Series are thinned first to what the eye can see (extremes of each pixel column), so the
/// fragment stays small for any number of samples. Cost: one gnuplot process.
std::string render_plot(const PlotSpec& spec);
std::string render_plot(const MapSpec& spec);

/// The same as a file of its own (.svg), for folders of figures.
/// @return false when gnuplot is missing or failed and nothing was written.
bool write_svg(const PlotSpec& spec, const std::string& path);
bool write_svg(const MapSpec& spec, const std::string& path);

/// The series as they are handed to gnuplot, thinned for a plot of `width` × `height` pixels.
Series decimate(const Series& series, int width, int height, bool log_x = false, bool log_y = false);

/// `<span>` legend entries of a plot.
std::string legend_html(const PlotSpec& spec);

}  // namespace heft::page
