// A robot's links and frictions put into the text of its URDF.
#pragma once

#include <string>

#include "heft/model/robot.hpp"
#include "heft/urdf/urdf_export.hpp"
#include "link_body.hpp"
#include "urdf_tree.hpp"
#include "xml_editor.hpp"

namespace heft::urdf {

/// Changes to the elements of one file, each noted in a report. All arguments of the constructor must outlive it.
class ElementWriter {
 public:
  ElementWriter(const std::string& text, const UrdfTree& tree, UrdfExportReport& report)
      : tree_(tree), report_(report), text_(text), editor_(text) {}

  /// Parameters of the moving link, with everything fixed to it; `<inertial>` of a fixed link becomes a comment.
  void write_link(const model::RobotJoint& joint);

  /// Coulomb and viscous coefficient.
  void write_friction(const model::RobotJoint& joint);

  /// The text with all changes.
  std::string result() { return editor_.result(); }

 private:
  void insert_inertial(const XmlElement& link, const LinkBody& body);

  /// mass and inertia are there: urdfdom has read them.
  void fill_inertial(const std::string& link_name, const XmlElement& inertial, const LinkBody& body);

  /// Turns an element into a comment that says why.
  void set_aside(const XmlElement& link, const XmlElement& inertial, const std::string& why);

  const UrdfTree& tree_;
  UrdfExportReport& report_;
  const std::string& text_;
  XmlEditor editor_;
};

}  // namespace heft::urdf
