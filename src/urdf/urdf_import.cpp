#include "heft/urdf/urdf_import.hpp"

#include "urdf_chain.hpp"
#include "urdf_document.hpp"
#include "urdf_text.hpp"
#include "urdfdom_parser.hpp"

namespace heft::urdf {

model::Robot load_urdf_string(const std::string& text, const std::string& name, const UrdfOptions& options,
                              std::vector<std::string>* warnings) {
  const Document document(text, name);
  check_structure(document);
  check_limits(document);
  const ::urdf::ModelInterfaceSharedPtr model = parse_with_urdfdom(text, document);
  return build_chain(document, *model, options, warnings);
}

model::Robot load_urdf(const std::string& path, const UrdfOptions& options,
                       std::vector<std::string>* warnings) {
  return load_urdf_string(read_urdf(path), path, options, warnings);
}

}  // namespace heft::urdf
