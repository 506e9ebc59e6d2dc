#include "io/export/csv.hpp"

#include <fmt/format.h>

#include <iterator>

namespace moraine {

namespace {

std::string header(const Image& image) {
  std::string text;
  constexpr const char* axes[] = {"x", "y", "z"};
  for (const FieldArray& array : image.fields) {
    const FieldInfo& row = info(array.field);
    for (int c = 0; c < row.components; ++c) {
      text += fmt::format("{}{}", text.empty() ? "" : ",", row.name);
      if (row.components == 3)
        text += fmt::format(".{}", axes[c]);
      else if (row.components > 1)
        text += fmt::format(".{}", c);
      if (!row.unit.empty()) text += fmt::format(" [{}]", row.unit);
    }
  }
  return text + '\n';
}

void append_values(std::string& text, const FieldArray& array, std::size_t grain) {
  const auto width = static_cast<std::size_t>(info(array.field).components);
  auto out = std::back_inserter(text);
  switch (info(array.field).type) {
    case FieldType::real:
      for (std::size_t c = 0; c < width; ++c)
        fmt::format_to(out, "{}{}", c == 0 ? "" : ",", array.reals[grain * width + c]);
      break;
    case FieldType::gid: fmt::format_to(out, "{}", array.gids[grain]); break;
    case FieldType::index: fmt::format_to(out, "{}", array.indices[grain]); break;
  }
}

}  // namespace

std::string csv_text(const Image& image) {
  Image ordered;  // gid first, whatever the order of the table
  for (const bool is_first : {true, false})
    for (const FieldArray& array : image.fields)
      if ((array.field == Field::gid) == is_first) ordered.fields.push_back(array);
  std::string text = header(ordered);
  for (std::size_t i = 0; i < image.n_grains; ++i) {
    for (std::size_t f = 0; f < ordered.fields.size(); ++f) {
      if (f > 0) text += ',';
      append_values(text, ordered.fields[f], i);
    }
    text += '\n';
  }
  return text;
}

}  // namespace moraine
