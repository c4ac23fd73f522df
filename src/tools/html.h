#pragma once

#include <string>
#include <vector>

/// Pieces of HTML as text. Contents are HTML already; what comes from outside goes through
/// escapeHtml first.
namespace tabletop_perception::tools {

/// Text as it may stand between tags and in a quoted attribute.
std::string escapeHtml(const std::string& text);

/// The name of a file beside the page as an address: all but letters, digits and . _ - as %XX.
std::string fileUrl(const std::string& file_name);

/// <tag attributes>content</tag>; `attributes` as they stand in the tag: class="warning".
std::string element(const std::string& tag, const std::string& content,
                    const std::string& attributes = "");

/// Plain text as an element.
std::string textElement(const std::string& tag, const std::string& text);

/// A row of plain texts, `cell` being td or th.
std::string tableRow(const std::vector<std::string>& texts, const std::string& cell = "td");

/// A picture that opens by itself when clicked, with a line of plain text below.
std::string figure(const std::string& file_name, const std::string& caption);

/// The whole page; `style` is CSS.
std::string htmlPage(const std::string& title, const std::string& style, const std::string& body);

}  // namespace tabletop_perception::tools
