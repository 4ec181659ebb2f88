#include "page_script.hpp"

#include "page_script_text.hpp"

namespace heft::page {

std::string script_html(const std::string& page) {
  const auto holds = [&](const char* what) { return page.find(what) != std::string::npos; };
  std::string parts;
  if (holds("<svg viewBox") && holds(" data-plot=")) parts += kScriptPlots;
  if (holds("<table>")) parts += kScriptTables;
  if (holds("<script class=\"file\"")) parts += kScriptFiles;
  return parts.empty() ? parts : "<script>" + (kScriptHead + parts) + "})();\n</script>\n";
}

}  // namespace heft::page
