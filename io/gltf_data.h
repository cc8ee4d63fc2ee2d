// SPDX-License-Identifier: GPL-3.0-or-later
// What a glTF holds besides its JSON: the container, buffers, views of them, and
// accessors, which say what the numbers in a view are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/geometry.h"
#include "io/gltf.h"
#include "io/gltf_json.h"
#include "io/stored_number.h"

namespace cellwarp
{

struct GltfView
{
    std::uint64_t start = 0, length = 0; ///< in the unpacked buffers [byte]
    std::uint64_t stride = 0;            ///< 0: elements stand one after the other
    bool is_compressed = false;          ///< what stands there is only a fallback
};

struct GltfSparse
{
    std::uint64_t count = 0, indices = 0, values = 0; ///< starts [byte]
    Scalar index_type = Scalar::UInt8;
};

struct GltfAccessor
{
    Scalar type = Scalar::Float32;
    std::size_t length = 1; ///< numbers of an element
    std::uint64_t count = 0, start = 0, stride = 0;
    bool is_normalised = false, is_compressed = false;
    bool has_data = false; ///< else it is all zeros
    std::optional<GltfSparse> sparse;

    std::size_t element_bytes() const { return length * stored_size(type); }
    bool is_plain() const
    {
        return has_data && !sparse && !is_compressed && type == Scalar::Float32;
    }
};

/// Of a whole file: its buffers go to Geometry::unpacked. With a plan it takes no
/// numbers, and the input gives what the file's bytes lack. Throws Fault::Malformed,
/// Fault::File.
class GltfData
{
public:
    GltfData(GeometryFile& file, GltfLayout& layout, GltfPlan* plan,
             const InputFile* input);

    const GltfJson& json() const { return *json_; }
    const std::vector<GltfAccessor>& accessors() const { return accessors_; }
    std::uint64_t body_bytes() const { return body_bytes_; } ///< of all buffers

    /// Zeros take no bytes in the file: they must not take many here.
    void check_zeros(std::size_t number) const;
    /// The first three numbers (of a scalar: the one) of each element.
    std::vector<Eigen::Vector3d> values_of(std::size_t number) const;
    /// All numbers of all elements.
    std::vector<double> numbers_of(std::size_t number) const;
    /// Two accessors of which one reads where numbers of the other change, in words;
    /// empty: none. \p changing: those whose numbers do.
    std::string overlap(const std::set<std::size_t>& changing) const;

private:
    [[noreturn]] void fail(const std::string& field, const std::string& what) const;
    std::uint32_t word(std::size_t at) const;
    void find_container();
    /// The bytes of a file beside; with a plan none, but the file.
    std::string read_beside(const std::string& uri, const std::string& where,
                            GltfLayout::Buffer& buffer);
    void read_buffers();
    void read_views();
    /// Where \p count elements of \p bytes start in a view, checked against its end.
    std::uint64_t start_in(const GltfView& view, std::uint64_t offset,
                           std::uint64_t stride, std::uint64_t count, std::uint64_t bytes,
                           const std::string& where) const;
    Scalar component_type(const GltfJson::Json& object, const std::string& where) const;
    const GltfView& view_of(const GltfJson::Json& object, const std::string& where) const;
    void read_accessors();
    GltfSparse read_sparse(const GltfJson::Json& object, const GltfAccessor& accessor,
                           const std::string& where) const;
    double stored(std::uint64_t at, const GltfAccessor& accessor) const;
    /// Calls load(byte, number) for each element, last for those that are told apart.
    template <class Load>
    void visit_elements(std::size_t number, Load&& load) const;

    GeometryFile& file_;
    Geometry& out_;
    GltfLayout& layout_;
    GltfPlan* plan_;
    const InputFile* input_;
    std::uint64_t file_bytes_;
    std::size_t chunk_size_ = 0;
    std::optional<GltfJson> json_;
    std::vector<std::uint64_t> declared_;               ///< byteLength of the buffers
    std::map<std::string, std::size_t> buffer_of_file_; ///< the first that names it
    std::vector<GltfView> views_;
    std::vector<GltfAccessor> accessors_;
    std::uint64_t body_bytes_ = 0; ///< of all buffers up to here
};

} // namespace cellwarp
