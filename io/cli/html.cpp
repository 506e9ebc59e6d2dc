#include "io/cli/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <regex>

namespace moraine {

namespace {

constexpr const char* style = R"(
body { font: 15px/1.5 "Source Serif 4", Georgia, "DejaVu Serif", serif; color: #1c1c1c; max-width: 62rem; margin: 2.5rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .4rem; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid #ccc; padding-bottom: .2rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1.2rem; margin: 1rem 0; }
dt { color: #666; } dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 1.2rem 0; } figure svg { width: 100%; height: auto; }
figcaption, caption { text-align: left; color: #444; font-size: .9rem; padding: .3rem 0; caption-side: top; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font: 13px/1.35 "DejaVu Sans", Arial, sans-serif; margin: .5rem 0 1rem; }
th, td { padding: .25rem .6rem; text-align: left; vertical-align: top; }
thead th { border-top: 2px solid #222; border-bottom: 1px solid #222; font-weight: 600; }
tbody tr:last-child td { border-bottom: 2px solid #222; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.marked td { background: #fff1dd; font-weight: 600; }
pre { font: 12px/1.4 "DejaVu Sans Mono", monospace; background: #f6f6f4; padding: .8rem; overflow-x: auto; }
summary { cursor: pointer; color: #444; }
@media print { body { margin: 0; max-width: none; } details { display: none; } }
)";

bool is_number(const std::string& text) {
  if (text.empty()) return false;
  const auto digit = [&](std::size_t i) {
    return i < text.size() && std::isdigit(static_cast<unsigned char>(text[i])) != 0;
  };
  return digit(0) || ((text[0] == '-' || text[0] == '+') && digit(1));
}

}  // namespace

std::string html_escaped(const std::string& text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  return out;
}

void HtmlPage::heading(const std::string& text) { body_ += "<h2>" + html_escaped(text) + "</h2>\n"; }

void HtmlPage::paragraph(const std::string& text) { body_ += "<p>" + html_escaped(text) + "</p>\n"; }

void HtmlPage::facts(const std::vector<std::pair<std::string, std::string>>& pairs) {
  body_ += "<dl>\n";
  for (const auto& [name, value] : pairs)
    if (!value.empty()) body_ += fmt::format("<dt>{}</dt><dd>{}</dd>\n", html_escaped(name), html_escaped(value));
  body_ += "</dl>\n";
}

void HtmlPage::table(const Table& table) {
  if (table.rows.size() < 2) return;
  body_ += fmt::format("<div class=\"wide\"><table><caption>Table {}. {}</caption>\n<thead><tr>", ++n_tables_,
                       html_escaped(table.caption));
  for (const std::string& name : table.rows[0]) body_ += "<th>" + html_escaped(name) + "</th>";
  body_ += "</tr></thead>\n<tbody>\n";
  for (std::size_t i = 1; i < table.rows.size(); ++i) {
    const bool is_marked = std::find(table.marked.begin(), table.marked.end(), i) != table.marked.end();
    body_ += is_marked ? "<tr class=\"marked\">" : "<tr>";
    for (const std::string& entry : table.rows[i]) {
      const bool is_value = &entry != &table.rows[i].front() && is_number(entry);
      body_ += fmt::format("<td{}>{}</td>", is_value ? " class=\"number\"" : "", html_escaped(entry));
    }
    body_ += "</tr>\n";
  }
  body_ += "</tbody></table></div>\n";
}

void HtmlPage::drawing(const std::string& svg, const std::string& caption) {
  std::string inside = svg;
  if (const std::size_t begin = inside.find("<svg"); begin != std::string::npos) inside.erase(0, begin);
  ++n_drawings_;
  const std::string prefix = fmt::format("d{}-", n_drawings_);
  inside = std::regex_replace(inside, std::regex("(\\bid=['\"])"), "$1" + prefix);
  inside = std::regex_replace(inside, std::regex("((?:xlink:)?href=['\"]#|url\\(#)"), "$1" + prefix);
  body_ += fmt::format("<figure>{}\n<figcaption>Figure {}. {}</figcaption></figure>\n", inside, n_drawings_,
                       html_escaped(caption));
}

void HtmlPage::listing(const std::string& title, const std::string& text) {
  body_ +=
      fmt::format("<details><summary>{}</summary><pre>{}</pre></details>\n", html_escaped(title), html_escaped(text));
}

std::string HtmlPage::text() const {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width\">\n<title>{0}</title>\n<style>{1}</style></head>\n<body>\n<h1>{0}</h1>\n{2}</"
      "body></html>\n",
      html_escaped(title_), style, body_);
}

}  // namespace moraine
