// A page that needs nothing beside itself: text, tables and drawings in one HTML file.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace moraine {

/// A text as HTML shows it.
std::string html_escaped(const std::string& text);

class HtmlPage {
 public:
  explicit HtmlPage(std::string title) : title_(std::move(title)) {}

  void heading(const std::string& text);
  void paragraph(const std::string& text);
  /// Names and what they are, one pair a line.
  void facts(const std::vector<std::pair<std::string, std::string>>& pairs);
  struct Table {
    std::string caption;
    std::vector<std::vector<std::string>> rows;  // the first is the head
    std::vector<std::size_t> marked;             // rows that stand out
  };
  /// Entries that begin with a digit or a sign are right-aligned, those of the first column are not.
  void table(const Table& table);
  /// An SVG file's text, without what only a file of its own needs. Names inside it get a prefix, so that several drawings
  /// do not take each other's.
  void drawing(const std::string& svg, const std::string& caption);
  /// A long text as it stands, folded until it is opened.
  void listing(const std::string& title, const std::string& text);

  std::string text() const;

 private:
  std::string title_, body_;
  int n_drawings_ = 0, n_tables_ = 0;
};

}  // namespace moraine
