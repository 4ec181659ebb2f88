#include "urdfdom_parser.hpp"

#include <mutex>

#include <console_bridge/console.h>
#include <urdf_parser/urdf_parser.h>

namespace heft::urdf {
namespace {

/// Collects the messages of urdfdom through console_bridge, which would go to standard error otherwise.
class MessageCatcher : public console_bridge::OutputHandler {
 public:
  MessageCatcher() : previous_(console_bridge::getOutputHandler()), level_(console_bridge::getLogLevel()) {
    console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_ERROR);
    console_bridge::useOutputHandler(this);
  }
  ~MessageCatcher() override {
    console_bridge::useOutputHandler(previous_);
    console_bridge::setLogLevel(level_);
  }
  MessageCatcher(const MessageCatcher&) = delete;
  MessageCatcher& operator=(const MessageCatcher&) = delete;

  void log(const std::string& text, console_bridge::LogLevel, const char*, int) override {
    if (!text_.empty()) text_ += "; ";
    text_ += text;
  }
  const std::string& text() const { return text_; }

 private:
  console_bridge::OutputHandler* previous_;
  console_bridge::LogLevel level_;
  std::string text_;
};

/// The link or joint that a message of urdfdom names; null when there is none.
const XmlElement* element_named_in(const std::string& text, const Document& document) {
  const XmlElement* first = nullptr;
  std::size_t place = std::string::npos;
  for (const auto* elements : {&document.joints(), &document.links()}) {
    for (const auto& [name, element] : *elements) {
      for (const std::string& form : {"[" + name + "]", "'" + name + "'"}) {
        const std::size_t found = text.find(form);
        if (found < place) {
          place = found;
          first = element;
        }
      }
    }
  }
  return first;
}

/// The text with everything blanked out that has no part in dynamics (document type, shapes, colours, other
/// tools' elements), so that what urdfdom complains about matters. Line breaks stay.
std::string without_looks(std::string text, const Document& document) {
  const auto blank_text = [&text](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      if (text[k] != '\n') text[k] = ' ';
    }
  };
  const auto blank = [&](const XmlElement& element) { blank_text(element.begin, element.end); };
  // TinyXML, behind urdfdom, stumbles over a document type with declarations of its own.
  const std::size_t document_type = text.find("<!DOCTYPE");
  if (document_type < document.root().begin) blank_text(document_type, document.root().begin);
  for (const XmlElement& element : document.root().children) {
    if (element.tag != "link" && element.tag != "joint") blank(element);
    for (const XmlElement& child : element.children) {
      if (child.tag == "visual" || child.tag == "collision") blank(child);
    }
  }
  return text;
}

}  // namespace

::urdf::ModelInterfaceSharedPtr parse_with_urdfdom(const std::string& text, const Document& document) {
  // console_bridge has one output handler for the whole process.
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  MessageCatcher catcher;
  ::urdf::ModelInterfaceSharedPtr model;
  std::string complaint;
  try {
    model = ::urdf::parseURDF(without_looks(text, document));
  } catch (const std::exception& error) {
    complaint = error.what();
  }
  if (complaint.empty()) complaint = catcher.text();
  if (model && complaint.empty()) return model;
  if (complaint.empty()) complaint = "no reason given";
  if (const XmlElement* element = element_named_in(complaint, document)) {
    document.fail_at(*element, "urdfdom refuses the file: {}; correct this element", complaint);
  }
  document.fail("urdfdom refuses the file: {}; correct it", complaint);
}

}  // namespace heft::urdf
