#include "html.h"

#include <cstdio>

namespace tabletop_perception::tools {

std::string escapeHtml(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string fileUrl(const std::string& file_name) {
  std::string url;
  for (const char c : file_name) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '.' || c == '_' || c == '-';
    if (plain) {
      url += c;
      continue;
    }
    char code[4];
    std::snprintf(code, sizeof code, "%%%02X", static_cast<unsigned char>(c));
    url += code;
  }
  return url;
}

std::string element(const std::string& tag, const std::string& content,
                    const std::string& attributes) {
  const std::string opening = attributes.empty() ? tag : tag + " " + attributes;
  return "<" + opening + ">" + content + "</" + tag + ">\n";
}

std::string textElement(const std::string& tag, const std::string& text) {
  return element(tag, escapeHtml(text));
}

std::string tableRow(const std::vector<std::string>& texts, const std::string& cell) {
  std::string cells;
  for (const auto& text : texts) cells += textElement(cell, text);
  return element("tr", cells);
}

std::string figure(const std::string& file_name, const std::string& caption) {
  const std::string address = "\"" + fileUrl(file_name) + "\"";
  const std::string picture =
      "<img src=" + address + " alt=\"" + escapeHtml(caption) + "\" loading=\"lazy\">";
  return element("figure",
                 element("a", picture, "href=" + address) + textElement("figcaption", caption));
}

std::string htmlPage(const std::string& title, const std::string& style, const std::string& body) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n" +
         textElement("title", title) + element("style", style) + "</head>\n" +
         element("body", body) + "</html>\n";
}

}  // namespace tabletop_perception::tools
