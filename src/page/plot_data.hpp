/// @file
/// What the page's script must know of a drawing to tell values from it.
#pragma once

#include <string>

#include "drawing.hpp"
#include "heft/page/plot.hpp"

namespace heft::page {

/// Value of the attribute `data-plot`, escaped for single quotes: JSON with the axes (`x`, `y`: `pixels` and `range`, each
/// at the low and the high end, `log`, `label`), the `series` in the order of the drawing's groups, `categories`, `marks`,
/// and `cut` where curves may leave the drawing. Not the curves: those are in the drawing, to a tenth of a pixel.
/// Empty when the place of the axes is not known.
std::string plot_data(const PlotSpec& spec, const Drawing& drawing);
/// The same of a map: `levels`, in words and in the order of the groups, instead of series, and what stands over and beside
/// them, to be drawn again where a part is enlarged: `tints`, the numbers between them (`borders`), `frames` and `places`.
std::string plot_data(const MapSpec& spec, const Drawing& drawing);

/// Some of the points of each series, as groups that are not seen, where the drawing has them: for the page's script, when a
/// picture stands in the place of a drawing with too many points. At most a few thousand, evenly over the drawing.
std::string series_points(const PlotSpec& spec, const Drawing& drawing);

}  // namespace heft::page
