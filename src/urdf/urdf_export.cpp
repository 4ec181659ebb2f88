#include "heft/urdf/urdf_export.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <random>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <urdf_exception/exception.h>
#include <urdf_model/pose.h>
#include <Eigen/Geometry>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "heft/model/dynamics.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "rigid_body.hpp"
#include "urdf_text.hpp"
#include "xml_outline.hpp"

namespace heft::urdf {
namespace {

/// States on which the written file's torques are compared, and how near they must be.
constexpr int kComparedStates = 50;
constexpr double kTorqueTolerance = 1e-9;

// -----------------------------------------------------------------------------------------------------
// Numbers.

/// The shortest text that reads back as the same double. No negative zero.
std::string number(double value) { return fmt::format("{}", value == 0.0 ? 0.0 : value); }

std::string numbers(const Eigen::Vector3d& v) {
  return fmt::format("{} {} {}", number(v[0]), number(v[1]), number(v[2]));
}

/// A link as `<inertial>` has it, in link axes.
struct LinkBody {
  double mass{0.0};
  Eigen::Vector3d com{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d about_com{Eigen::Matrix3d::Zero()};
};

LinkBody to_body(const InertialParameters<double>& p) {
  LinkBody body;
  body.mass = p[kMass];
  body.about_com << p[kIxx], p[kIxy], p[kIxz], p[kIxy], p[kIyy], p[kIyz], p[kIxz], p[kIyz], p[kIzz];
  if (p[kMass] == 0.0) return body;
  const Eigen::Vector3d first_moment(p[kMcx], p[kMcy], p[kMcz]);
  // c = h / m,   I_c = I_o - m (|c|² E - c cᵀ)
  body.com = snapped(Eigen::Vector3d(first_moment / p[kMass]));
  const Eigen::Vector3d& c = body.com;
  body.about_com -= body.mass * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  return body;
}

bool is_zero(const InertialParameters<double>& p) {
  return std::all_of(p.begin(), p.end(), [](double value) { return value == 0.0; });
}

// -----------------------------------------------------------------------------------------------------
// The text and what is put into it.

class Editor {
 public:
  explicit Editor(const std::string& text)
      : text_(text), newline_(text.find("\r\n") == std::string::npos ? "\n" : "\r\n") {}

  /// Puts `content` in the place of text [begin, end).
  void replace(std::size_t begin, std::size_t end, std::string content) {
    if (std::string_view(text_).substr(begin, end - begin) != content)
      edits_.push_back({begin, end, std::move(content)});
  }

  /// Gives the element an attribute: its value changes, or it comes behind the ones that are there.
  void set_attribute(const XmlElement& element, std::string_view name, const std::string& value) {
    std::size_t behind = element.begin + 1 + element.tag.size();
    for (std::size_t k = 0; k < element.attributes.size(); ++k) {
      const auto& [begin, end] = element.attribute_places[k];
      if (element.attributes[k].first == name) {
        replace(begin, end, value);
        return;
      }
      behind = end + 1;
    }
    replace(behind, behind, fmt::format(" {}=\"{}\"", name, value));
  }

  /// Puts an element, given line by line with the indent of each, into a parent: behind the child `after`, or in
  /// front of all children.
  struct Line {
    int depth{0};  ///< below the parent's children
    std::string text;
  };
  void insert(const XmlElement& parent, const XmlElement* after, const std::vector<Line>& lines) {
    const XmlElement* sibling =
        after == nullptr && !parent.children.empty() ? &parent.children.front() : after;
    const bool on_one_line = sibling != nullptr && !indent(sibling->begin);
    const std::string outer = indent(parent.begin).value_or("");
    const std::string inner =
        sibling != nullptr ? indent(sibling->begin).value_or("") : outer + indent_step();
    std::string block;
    for (const Line& line : lines) {
      if (!on_one_line) {
        block += newline_ + inner;
        for (int k = 0; k < line.depth; ++k) block += indent_step();
      }
      block += line.text;
    }
    if (parent.open_end == parent.end) {  // <link name="a"/>
      const std::string closed = fmt::format(">{}{}{}</{}>", block, newline_, outer, parent.tag);
      replace(parent.end - 2, parent.end, closed);
      return;
    }
    std::size_t at = after != nullptr ? after->end : parent.open_end;
    if (!on_one_line) at = behind_comments(at);
    // <link name="a"></link>: the closing tag gets a line of its own.
    const bool closes_here = sibling == nullptr && text_.compare(at, 2, "</") == 0;
    if (closes_here) block += newline_ + outer;
    replace(at, at, block);
  }

  /// The text with everything put in.
  std::string result() {
    std::stable_sort(edits_.begin(), edits_.end(),
                     [](const Edit& a, const Edit& b) { return a.begin < b.begin; });
    std::string out;
    std::size_t at = 0;
    for (const Edit& edit : edits_) {
      out.append(text_, at, edit.begin - at);
      out += edit.content;
      at = edit.end;
    }
    return out.append(text_, at, std::string::npos);
  }

 private:
  struct Edit {
    std::size_t begin{0}, end{0};
    std::string content;
  };

  /// White space in front of what begins its line here; nothing when something else precedes it.
  std::optional<std::string> indent(std::size_t place) const {
    const std::size_t before = place == 0 ? std::string::npos : text_.rfind('\n', place - 1);
    const std::size_t line = before == std::string::npos ? 0 : before + 1;
    std::string space = text_.substr(line, place - line);
    if (space.find_first_not_of(" \t") != std::string::npos) return std::nullopt;
    return space;
  }

  /// One level of indentation: that of the first element inside the root.
  const std::string& indent_step() {
    if (step_.empty()) {
      step_ = "  ";
      const XmlElement root = outline_xml(text_);
      const std::string outer = indent(root.begin).value_or("");
      for (const XmlElement& child : root.children) {
        const std::optional<std::string> inner = indent(child.begin);
        if (!inner || inner->size() <= outer.size() || !inner->starts_with(outer)) continue;
        step_ = inner->substr(outer.size());
        break;
      }
    }
    return step_;
  }

  /// Behind the comments that end the line here: they refer to what precedes them.
  std::size_t behind_comments(std::size_t at) const {
    const std::size_t start = at;
    for (std::size_t end = at;;) {
      const std::size_t next = std::min(text_.find_first_not_of(" \t", end), text_.size());
      if (next == text_.size() || text_[next] == '\n' || text_[next] == '\r') return at;
      if (text_.compare(next, 4, "<!--") != 0) return start;
      end = text_.find("-->", next + 4) + 3;
      at = end;
    }
  }

  const std::string& text_;
  std::string newline_;
  std::string step_;
  std::vector<Edit> edits_;
};

/// Links and joints of the text, and what is fixed to what.
struct Tree {
  explicit Tree(const std::string& text) : root(outline_xml(text)) {
    for (const XmlElement& element : root.children) {
      if (element.tag == "link") links.emplace(*element.attribute("name"), &element);
      if (element.tag != "joint") continue;
      joints.emplace(*element.attribute("name"), &element);
      if (*element.attribute("type") == "fixed") {
        fixed.emplace(*element.child("parent")->attribute("link"),
                      *element.child("child")->attribute("link"));
      }
    }
  }
  // Its maps point into its own elements.
  Tree(const Tree&) = delete;
  Tree& operator=(const Tree&) = delete;

  /// The links fixed to a link, over any number of fixed joints, in the file's order of each.
  std::vector<std::string> fixed_to(const std::string& link) const {
    std::vector<std::string> found;
    const auto [first, last] = fixed.equal_range(link);
    for (auto child = first; child != last; ++child) {
      found.push_back(child->second);
      const std::vector<std::string> further = fixed_to(child->second);
      found.insert(found.end(), further.begin(), further.end());
    }
    return found;
  }

  XmlElement root;
  std::map<std::string, const XmlElement*> links, joints;
  std::multimap<std::string, std::string> fixed;  ///< child by parent
};

// -----------------------------------------------------------------------------------------------------
// What may be written.

UrdfOptions options_for(const model::Robot& robot, bool accept_impossible) {
  UrdfOptions options;
  options.base_link = robot.base_link;
  options.tip_link = robot.tip_link;
  options.accept_impossible_values = accept_impossible;
  return options;
}

/// The file's chain must be the robot's: parameters about other link frames mean something else.
void check_same_chain(const model::Robot& file, const model::Robot& robot, const std::string& name) {
  constexpr const char* kRemedy = "write into the URDF that the robot was read from";
  if (file.num_joints() != robot.num_joints()) {
    throw UrdfError(fmt::format("{}: {} joints move between \"{}\" and \"{}\"; expected the robot's {}; {}",
                                name, file.num_joints(), file.base_link, file.tip_link, robot.num_joints(),
                                kRemedy));
  }
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const model::RobotJoint& there = file.joints[k];
    const model::RobotJoint& here = robot.joints[k];
    if (there.name != here.name || there.link_name != here.link_name) {
      throw UrdfError(
          fmt::format("{}: joint {} is \"{}\" with link \"{}\"; expected \"{}\" with link \"{}\" as in "
                      "the robot; {}",
                      name, k + 1, there.name, there.link_name, here.name, here.link_name, kRemedy));
    }
    const auto far = [](const auto& a, const auto& b) {
      for (std::size_t i = 0; i < a.size(); ++i) {
        if (!(std::abs(a[i] - b[i]) <= 1e-9)) return true;
      }
      return false;
    };
    if (there.joint.type != here.joint.type || far(there.joint.rotation, here.joint.rotation) ||
        far(there.joint.position, here.joint.position) || far(there.joint.axis, here.joint.axis)) {
      throw UrdfError(
          fmt::format("{}: joint \"{}\" has another type, place or axis than in the robot; expected the "
                      "same; {}",
                      name, here.name, kRemedy));
    }
  }
}

/// Why a link's parameters are physically impossible; empty when they are possible.
std::string fault_of(const InertialParameters<double>& p) {
  if (!(p[kMass] > 0.0)) return fmt::format("mass {:.6g} kg: expected above zero", p[kMass]);
  return impossibility(to_body(p).about_com);
}

/// Refuses values that cannot be written, and, unless allowed, impossible ones.
class Checker {
 public:
  Checker(const Tree& tree, const std::string& name, bool allow_impossible, std::vector<std::string>& notes)
      : tree_(tree), name_(name), allow_impossible_(allow_impossible), notes_(notes) {}

  void check(const model::Robot& robot, const model::Robot& file) {
    for (std::size_t k = 0; k < robot.joints.size(); ++k) {
      const model::RobotJoint& joint = robot.joints[k];
      check_link(joint, is_zero(file.joints[k].link));
      check_friction(joint, "Coulomb friction", joint.actuation.coulomb_friction);
      check_friction(joint, "viscous friction", joint.actuation.viscous_friction);
    }
    if (impossible_.empty()) return;
    if (!allow_impossible_) {
      const std::string more =
          impossible_.size() == 1 ? "" : fmt::format(" (and {} more)", impossible_.size() - 1);
      throw UrdfError(
          fmt::format("{}{}; not written; fit a physically consistent model (method physical), or allow "
                      "impossible values",
                      impossible_.front(), more));
    }
    for (const std::string& fault : impossible_) notes_.push_back(fault + "; written as it is");
  }

 private:
  void check_link(const model::RobotJoint& joint, bool massless_in_file) {
    const XmlElement& element = *tree_.links.at(joint.link_name);
    const InertialParameters<double>& p = joint.link;
    if (!std::all_of(p.begin(), p.end(), [](double value) { return std::isfinite(value); })) {
      throw UrdfError(at(element,
                         "link \"{}\": its parameters [{:.6g}] are not all finite; expected numbers; check "
                         "the fit",
                         joint.link_name, fmt::join(p, ", ")));
    }
    if (is_zero(p) && massless_in_file) return;
    const double largest_moment = std::max({std::abs(p[kMcx]), std::abs(p[kMcy]), std::abs(p[kMcz])});
    if (p[kMass] == 0.0 && largest_moment > 0.0) {
      throw UrdfError(
          at(element,
             "link \"{}\": no mass but a first moment of {:.6g} kg·m, which URDF cannot express; expected "
             "a mass above zero; fit a physically consistent model (method physical)",
             joint.link_name, largest_moment));
    }
    if (const std::string fault = fault_of(p); !fault.empty())
      impossible_.push_back(at(element, "link \"{}\": {}", joint.link_name, fault));
  }

  void check_friction(const model::RobotJoint& joint, const char* what, double value) {
    const XmlElement& element = *tree_.joints.at(joint.name);
    if (!std::isfinite(value)) {
      throw UrdfError(at(element, "joint \"{}\": {} {:.6g}; expected a finite number; check the fit",
                         joint.name, what, value));
    }
    if (value < 0.0) {
      impossible_.push_back(
          at(element, "joint \"{}\": {} {:.6g}: expected not below zero", joint.name, what, value));
    }
  }

  template <typename... Args>
  std::string at(const XmlElement& element, fmt::format_string<Args...> format, Args&&... args) const {
    return fmt::format("{}:{}: {}", name_, element.line, fmt::format(format, std::forward<Args>(args)...));
  }

  const Tree& tree_;
  const std::string& name_;
  bool allow_impossible_;
  std::vector<std::string>& notes_;
  std::vector<std::string> impossible_;
};

// -----------------------------------------------------------------------------------------------------
// Elements.

/// Turn of the inertial frame that the element has, when it can be kept: link axes from its axes. Nothing when
/// reading makes it another one (a rounded quarter turn, made exact), since other readers do not.
std::optional<Eigen::Matrix3d> turn_to_keep(const XmlElement& inertial) {
  const XmlElement* origin = inertial.child("origin");
  const std::string* rpy = origin == nullptr ? nullptr : origin->attribute("rpy");
  if (rpy == nullptr) return Eigen::Matrix3d::Identity();
  ::urdf::Pose pose;
  try {
    pose.rotation.init(*rpy);
  } catch (const ::urdf::ParseError&) {
    return std::nullopt;
  }
  const Eigen::Matrix3d turn = placement_of(pose).R;
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
  pose.rotation.getQuaternion(x, y, z, w);
  const Eigen::Matrix3d as_written = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  if ((turn - as_written).cwiseAbs().maxCoeff() > 1e-13) return std::nullopt;
  return turn;
}

class Writer {
 public:
  Writer(const std::string& text, const Tree& tree, UrdfExportReport& report)
      : tree_(tree), report_(report), text_(text), editor_(text) {}

  void write_link(const model::RobotJoint& joint) {
    const XmlElement& link = *tree_.links.at(joint.link_name);
    const XmlElement* inertial = link.child("inertial");
    const LinkBody body = to_body(joint.link);
    if (is_zero(joint.link)) {
      if (inertial != nullptr) set_aside(link, *inertial, "heft: this link has no mass");
    } else if (inertial == nullptr) {
      insert_inertial(link, body);
      report_.inserted_links.push_back(joint.link_name);
    } else {
      fill_inertial(joint.link_name, *inertial, body);
      report_.changed_links.push_back(joint.link_name);
    }
    for (const std::string& name : tree_.fixed_to(joint.link_name)) {
      const XmlElement& fixed = *tree_.links.at(name);
      const XmlElement* own = fixed.child("inertial");
      if (own == nullptr) continue;
      set_aside(fixed, *own,
                fmt::format("heft: counted in link \"{}\", which this link is fixed to", joint.link_name));
      report_.notes.push_back(
          fmt::format("link \"{}\" is fixed to \"{}\", which carries the parameters of both; its own "
                      "<inertial> is a comment now",
                      name, joint.link_name));
    }
  }

  void write_friction(const model::RobotJoint& joint) {
    const XmlElement& element = *tree_.joints.at(joint.name);
    const std::string damping = number(joint.actuation.viscous_friction);
    const std::string friction = number(joint.actuation.coulomb_friction);
    if (const XmlElement* dynamics = element.child("dynamics")) {
      editor_.set_attribute(*dynamics, "damping", damping);
      editor_.set_attribute(*dynamics, "friction", friction);
    } else {
      const XmlElement* limit = element.child("limit");
      // A joint has children: its parent and child links at least.
      editor_.insert(element, limit != nullptr ? limit : &element.children.back(),
                     {{0, fmt::format("<dynamics damping=\"{}\" friction=\"{}\"/>", damping, friction)}});
    }
    report_.changed_joints.push_back(joint.name);
  }

  std::string result() { return editor_.result(); }

 private:
  static std::array<std::pair<const char*, std::string>, 6> entries(const Eigen::Matrix3d& inertia) {
    return {{{"ixx", number(inertia(0, 0))},
             {"ixy", number(inertia(0, 1))},
             {"ixz", number(inertia(0, 2))},
             {"iyy", number(inertia(1, 1))},
             {"iyz", number(inertia(1, 2))},
             {"izz", number(inertia(2, 2))}}};
  }

  void insert_inertial(const XmlElement& link, const LinkBody& body) {
    std::string inertia;
    for (const auto& [name, value] : entries(body.about_com))
      inertia += fmt::format(" {}=\"{}\"", name, value);
    editor_.insert(link, nullptr,
                   {{0, "<inertial>"},
                    {1, fmt::format("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", numbers(body.com))},
                    {1, fmt::format("<mass value=\"{}\"/>", number(body.mass))},
                    {1, fmt::format("<inertia{}/>", inertia)},
                    {0, "</inertial>"}});
  }

  /// mass and inertia are there: urdfdom has read them.
  void fill_inertial(const std::string& link_name, const XmlElement& inertial, const LinkBody& body) {
    const std::optional<Eigen::Matrix3d> kept = turn_to_keep(inertial);
    const XmlElement* origin = inertial.child("origin");
    if (!kept) {
      editor_.set_attribute(*origin, "rpy", "0 0 0");
      report_.notes.push_back(
          fmt::format("link \"{}\": its inertial frame was turned by a rounded angle (rpy); the inertia "
                      "is in link axes now",
                      link_name));
    }
    // I_F = Rᵀ I_c R, in the axes of the inertial frame F; R turns components in F into those in link axes.
    const Eigen::Matrix3d turn = kept.value_or(Eigen::Matrix3d::Identity());
    const Eigen::Matrix3d turned = turn.transpose() * body.about_com * turn;
    const std::string place = numbers(body.com);
    if (origin != nullptr) {
      editor_.set_attribute(*origin, "xyz", place);
    } else if (!body.com.isZero(0.0)) {
      editor_.insert(inertial, nullptr, {{0, fmt::format("<origin xyz=\"{}\" rpy=\"0 0 0\"/>", place)}});
    }
    editor_.set_attribute(*inertial.child("mass"), "value", number(body.mass));
    for (const auto& [name, value] : entries(0.5 * (turned + turned.transpose())))
      editor_.set_attribute(*inertial.child("inertia"), name, value);
  }

  /// Turns an element into a comment that says why.
  void set_aside(const XmlElement& link, const XmlElement& inertial, const std::string& why) {
    std::string inside =
        fmt::format("{}: {}", why, text_.substr(inertial.begin, inertial.end - inertial.begin));
    // A comment must not hold two hyphens in a row.
    for (std::size_t at = inside.find("--"); at != std::string::npos; at = inside.find("--", at))
      inside.replace(at, 2, "- -");
    editor_.replace(inertial.begin, inertial.end, fmt::format("<!-- {} -->", inside));
    report_.set_aside_links.push_back(*link.attribute("name"));
  }

  const Tree& tree_;
  UrdfExportReport& report_;
  const std::string& text_;
  Editor editor_;
};

// -----------------------------------------------------------------------------------------------------
// The proof.

/// The robot without what URDF has no tag for.
model::Robot without_untagged(model::Robot robot) {
  robot.couplings.clear();
  for (model::RobotJoint& joint : robot.joints) {
    joint.actuation.rotor_inertia = 0.0;
    joint.actuation.friction_offset = 0.0;
  }
  return robot;
}

bool has_untagged(const model::Robot& robot) {
  return !robot.couplings.empty() ||
         std::any_of(robot.joints.begin(), robot.joints.end(), [](const model::RobotJoint& joint) {
           return joint.actuation.rotor_inertia != 0.0 || joint.actuation.friction_offset != 0.0;
         });
}

/// Largest difference of the joint torques on random states, over the largest torque.
double torque_difference(const model::Robot& found, const model::Robot& expected) {
  const model::Dynamics a(found), b(expected);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto vector = [&](double scale) -> Eigen::VectorXd {
    return Eigen::VectorXd::NullaryExpr(expected.num_joints(), [&] { return scale * uniform(random); });
  };
  double largest = 0.0, difference = 0.0;
  for (int k = 0; k < kComparedStates; ++k) {
    const Eigen::VectorXd q = vector(3.2), qd = vector(4.0), qdd = vector(20.0);
    const Eigen::VectorXd torque = b.joint_torque(q, qd, qdd);
    const Eigen::VectorXd error = a.joint_torque(q, qd, qdd) - torque;
    if (!error.allFinite()) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, torque.cwiseAbs().maxCoeff());
    difference = std::max(difference, error.cwiseAbs().maxCoeff());
  }
  return difference == 0.0 ? 0.0 : difference / largest;
}

/// @throws Error when the robot read again moves differently.
double proven_torques(const model::Robot& found, const model::Robot& expected, const std::string& name) {
  const double difference = torque_difference(found, expected);
  if (!(difference <= kTorqueTolerance)) {
    throw Error(fmt::format(
        "{}: read again, its torques differ from the robot's by {:.3g} of the largest; expected "
        "within {:.0e}; nothing was written; this is a defect, or parameters so far from any body "
        "that mass and centre of mass cannot hold them",
        name, difference, kTorqueTolerance));
  }
  return difference;
}

}  // namespace

std::string urdf_with_parameters(const std::string& original_text, const std::string& name,
                                 const model::Robot& robot, const UrdfExportOptions& options,
                                 UrdfExportReport* report) {
  UrdfExportReport done;
  const model::Robot file = load_urdf_string(original_text, name, options_for(robot, true));
  check_same_chain(file, robot, name);
  const Tree tree(original_text);
  Checker(tree, name, options.allow_impossible, done.notes).check(robot, file);

  Writer writer(original_text, tree, done);
  for (std::size_t k = 0; k < robot.joints.size(); ++k) {
    const model::RobotJoint& there = file.joints[k];
    const model::RobotJoint& here = robot.joints[k];
    if (there.link != here.link) writer.write_link(here);
    if (there.actuation.coulomb_friction != here.actuation.coulomb_friction ||
        there.actuation.viscous_friction != here.actuation.viscous_friction) {
      writer.write_friction(here);
    }
  }
  std::string text = writer.result();

  model::Robot again = load_urdf_string(text, name, options_for(robot, options.allow_impossible));
  again.gravity = robot.gravity;
  done.torque_difference = proven_torques(again, without_untagged(robot), name);
  if (report != nullptr) *report = std::move(done);
  return text;
}

std::string side_file_of(const std::string& path_out) {
  if (host::named_descriptor(path_out)) return {};
  return std::filesystem::path(path_out).replace_extension(".heft.json").string();
}

void write_urdf(const std::string& original_path, const model::Robot& robot, const std::string& path_out,
                const UrdfExportOptions& options, UrdfExportReport* report) {
  UrdfExportReport done;
  const std::string text =
      urdf_with_parameters(read_urdf(original_path), original_path, robot, options, &done);

  const bool is_needed = has_untagged(robot) || options.model.has_value();
  const std::string side_file =
      options.side_file.value_or(is_needed ? side_file_of(path_out) : std::string());
  if (!side_file.empty()) {
    model::ModelFile model = model::make_model(robot);
    if (options.model) {
      model.standard_deviations = options.model->standard_deviations;
      model.covariance = options.model->covariance;
      model.fit = options.model->fit;
      model.provenance = options.model->provenance;
      model.other_fields = options.model->other_fields;
    }
    const std::string json = model::to_json(model);
    // The two files together must be the whole robot.
    model::Robot whole = load_urdf_string(text, path_out, options_for(robot, options.allow_impossible));
    whole.gravity = robot.gravity;
    model::apply(model::parse_model(json, side_file), whole);
    proven_torques(whole, robot, side_file);
    host::write_file_atomically(side_file, json);
    done.side_file = side_file;
    if (has_untagged(robot)) {
      done.notes.push_back(fmt::format(
          "rotor inertia, friction offset and gear couplings have no tag in a URDF; they are in {}",
          side_file));
    }
  } else if (has_untagged(robot)) {
    done.notes.push_back(
        "rotor inertia, friction offset and gear couplings have no tag in a URDF; they were not written");
  }
  try {
    host::write_file_atomically(path_out, text);
  } catch (...) {
    std::error_code ignored;
    if (!done.side_file.empty() && !host::named_descriptor(done.side_file))
      std::filesystem::remove(done.side_file, ignored);
    throw;
  }
  if (report != nullptr) *report = std::move(done);
}

}  // namespace heft::urdf
