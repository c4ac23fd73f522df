#include "html.h"

#include <gtest/gtest.h>

namespace tabletop_perception::tools {
namespace {

TEST(Html, escapesWhatWouldEndATextOrAnAttribute) {
  EXPECT_EQ(escapeHtml("<a href=\"x\">'&amp;'"), "&lt;a href=&quot;x&quot;&gt;&#39;&amp;amp;&#39;");
  EXPECT_EQ(tableRow({"a<b", "c"}, "th"), "<tr><th>a&lt;b</th>\n<th>c</th>\n</tr>\n");
}

TEST(Html, encodesFileNamesForAddresses) {
  EXPECT_EQ(fileUrl("scene_1-a.png"), "scene_1-a.png");
  EXPECT_EQ(fileUrl("50% #\"\xC3\xA4?.png"), "50%25%20%23%22%C3%A4%3F.png");
}

TEST(Html, aFigureShowsItsFileAndEscapesItsCaption) {
  const auto html = figure("a b.png", "<c>");
  EXPECT_NE(html.find("src=\"a%20b.png\""), std::string::npos) << html;
  EXPECT_NE(html.find("<figcaption>&lt;c&gt;</figcaption>"), std::string::npos) << html;
}

}  // namespace
}  // namespace tabletop_perception::tools
