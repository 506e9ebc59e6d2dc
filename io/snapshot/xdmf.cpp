#include "io/snapshot/xdmf.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <string_view>

namespace moraine::xdmf {

namespace {

constexpr std::string_view entry_start = "    <Grid Name=\"step ";
constexpr std::string_view entry_end = "\n    </Grid>\n";

std::string ended(std::string text) {
  text.pop_back();  // the end begins with a new line
  return text.append(entry_end);
}

std::string time_text(double time) { return fmt::format("      <Time Value=\"{}\"/>\n", time); }

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

std::string entry(std::uint64_t step, double time, const std::string& content) {
  return ended(fmt::format("{}{}\" GridType=\"Uniform\">\n", entry_start, step) + time_text(time) + content);
}

std::string entry_of_parts(std::uint64_t step, double time, const std::string& parts) {
  return ended(fmt::format("{}{}\" GridType=\"Collection\" CollectionType=\"Spatial\">\n", entry_start, step) +
               time_text(time) + parts);
}

std::string part(const std::string& name, const std::string& content) {
  return fmt::format("      <Grid Name=\"{}\" GridType=\"Uniform\">\n{}      </Grid>\n", escaped(name), content);
}

std::string series(const std::string& name, const Entries& entries) {
  std::string text = fmt::format(
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"2.0\">\n "
      "<Domain>\n"
      "  <Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
      escaped(name));
  for (const auto& [step, one] : entries) text += one;
  return text + "  </Grid>\n </Domain>\n</Xdmf>\n";
}

Entries parse(const std::string& text) {
  Entries entries;
  for (std::size_t at = text.find(entry_start); at != std::string::npos; at = text.find(entry_start, at + 1)) {
    const std::size_t end = text.find(entry_end, at);
    if (end == std::string::npos) break;
    entries[std::strtoull(text.c_str() + at + entry_start.size(), nullptr, 10)] =
        text.substr(at, end + entry_end.size() - at);
  }
  return entries;
}

std::string data_item(const std::string& file, const std::string& dataset, const std::string& shape, const char* type,
                      int bytes) {
  return fmt::format("<DataItem Format=\"HDF\" NumberType=\"{}\" Precision=\"{}\" Dimensions=\"{}\">{}:/{}</DataItem>",
                     type, bytes, shape, escaped(file), escaped(dataset));
}

std::string attribute(const std::string& name, const char* kind, const char* centre, const std::string& item) {
  return fmt::format("      <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", escaped(name),
                     kind, centre, item);
}

std::string cells(const std::array<int, 3>& n, const Box& box) {
  const Vec3 low = box.low, size = box.size();
  const auto triple = [](double z, double y, double x) {
    return fmt::format(
        "<DataItem Format=\"XML\" NumberType=\"Float\" Precision=\"8\" Dimensions=\"3\">{} {} {}</DataItem>", z, y, x);
  };
  return fmt::format("      <Topology TopologyType=\"3DCoRectMesh\" Dimensions=\"{} {} {}\"/>\n", n[2] + 1, n[1] + 1,
                     n[0] + 1) +
         fmt::format("      <Geometry GeometryType=\"ORIGIN_DXDYDZ\">{}{}</Geometry>\n", triple(low.z, low.y, low.x),
                     triple(size.z / n[2], size.y / n[1], size.x / n[0]));
}

std::string on_cells(const std::string& name, const std::array<int, 3>& n, const std::string& file,
                     const std::string& dataset) {
  return attribute(name, "Scalar", "Cell", data_item(file, dataset, fmt::format("{} {} {}", n[2], n[1], n[0])));
}

}  // namespace moraine::xdmf
