#include "xml_outline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace heft::urdf {
namespace {

using testing::HasSubstr;

std::string error_of(std::string_view text) {
  try {
    outline_xml(text);
  } catch (const XmlOutlineError& error) {
    return std::to_string(error.line) + ": " + error.what();
  }
  return "none";
}

TEST(XmlOutline, KnowsTheLineOfEveryElement) {
  const XmlElement root = outline_xml(
      "<?xml version=\"1.0\"?>\n<!-- a comment\n <link name='no'/> -->\n<robot name='r'>\n  text\n  <link\n"
      "     name=\"a b\"/>\n  <joint name='j'><axis xyz='0 0 1'/>\n  <limit/></joint>\n<![CDATA[ <x> "
      "]]></robot>\n");
  EXPECT_EQ(root.tag, "robot");
  EXPECT_EQ(root.line, 4u);
  ASSERT_EQ(root.children.size(), 2u);
  EXPECT_EQ(root.children[0].line, 6u);
  ASSERT_NE(root.children[0].attribute("name"), nullptr);
  EXPECT_EQ(*root.children[0].attribute("name"), "a b");
  EXPECT_EQ(root.children[0].attribute("other"), nullptr);
  ASSERT_NE(root.children[1].child("limit"), nullptr);
  EXPECT_EQ(root.children[1].child("limit")->line, 9u);
  EXPECT_EQ(root.children[1].child("mimic"), nullptr);
}

TEST(XmlOutline, KnowsWhereTagsAndValuesStand) {
  const std::string text = "<a  x = '1'\n y=\"&lt;2&amp;3&unknown;\"><b/></a >";
  const XmlElement root = outline_xml(text);
  EXPECT_EQ(text.substr(root.begin, root.open_end - root.begin), "<a  x = '1'\n y=\"&lt;2&amp;3&unknown;\">");
  ASSERT_EQ(root.attribute_places.size(), 2u);
  const auto value = [&](std::size_t k) {
    return text.substr(root.attribute_places[k].first,
                       root.attribute_places[k].second - root.attribute_places[k].first);
  };
  EXPECT_EQ(value(0), "1");
  EXPECT_EQ(value(1), "&lt;2&amp;3&unknown;");
  EXPECT_EQ(*root.attribute("y"), "<2&3&unknown;");
  EXPECT_EQ(root.end, text.size());
  EXPECT_EQ(root.children[0].open_end, root.children[0].end);
}

TEST(XmlOutline, PassesOverADocumentType) {
  EXPECT_EQ(outline_xml("<!DOCTYPE a [ <!ENTITY b \"<c>]\"> <!-- ] > ' --> ]\n><a/>").line, 2u);
  EXPECT_EQ(error_of("\n<!DOCTYPE a [ <b>"), "2: found a declaration that does not end");
}

TEST(XmlOutline, SaysWhereTheTextStopsBeingXml) {
  EXPECT_EQ(error_of("just text"), "1: found no XML element");
  EXPECT_EQ(error_of("<a>\n<b>\n</a>"), "3: found </a> where </b> is due (opened in line 2)");
  EXPECT_EQ(error_of("<a>\n<b/>\n"), "1: found <a> that is never closed");
  EXPECT_EQ(error_of("<a>\n</a>\n<b/>"), "3: found more after the end of <a>");
  EXPECT_EQ(error_of("</a>"), "1: found a closing tag that closes nothing");
  EXPECT_EQ(error_of("<a\nx=1/>"), "2: found no quotes around the value of x in <a>");
  EXPECT_EQ(error_of("<a x=\"1/>"), "1: found no closing quote for x in <a>");
  EXPECT_EQ(error_of("<a x/>"), "1: found a broken attribute in <a>");
  EXPECT_EQ(error_of("<a>\n<!-- no end"), "2: found a comment that does not end");
  EXPECT_EQ(error_of("< a/>"), "1: found '<' without an element name");
  EXPECT_EQ(error_of("<a "), "1: found <a> that does not end");
}

TEST(XmlOutline, RefusesEndlessNesting) {
  std::string deep;
  for (int k = 0; k < 100000; ++k) deep += "<a>";
  EXPECT_THAT(error_of(deep), HasSubstr("nested too deeply"));
}

}  // namespace
}  // namespace heft::urdf
