// SPDX-License-Identifier: GPL-3.0-or-later
// Measures a plain loop that reads a mesh and writes it again: the peer of everything
// that the program does beside the edit itself. It checks next to nothing, and reads OBJ
// with vertices and triangles, and binary PLY with three numbers of one type a vertex and
// triangles. Prints seconds of reading, writing, and both, as JSON.
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace
{

struct Mesh
{
    std::vector<double> places;        ///< three a vertex
    std::vector<std::int32_t> corners; ///< three a triangle, from 0
};

[[noreturn]] void fail(const std::string& reason)
{
    std::fprintf(stderr, "plain_loop: %s\n", reason.c_str());
    std::exit(2);
}

std::string read_all(const char* path)
{
    std::FILE* const file = std::fopen(path, "rb");
    if (!file)
        fail("cannot open " + std::string(path));
    std::fseek(file, 0, SEEK_END);
    std::string bytes(static_cast<std::size_t>(std::ftell(file)), '\0');
    std::rewind(file);
    if (std::fread(bytes.data(), 1, bytes.size(), file) != bytes.size())
        fail("cannot read " + std::string(path));
    std::fclose(file);
    return bytes;
}

void write_all(const char* path, const std::string& bytes)
{
    std::FILE* const file = std::fopen(path, "wb");
    if (!file || std::fwrite(bytes.data(), 1, bytes.size(), file) != bytes.size() ||
        std::fclose(file) != 0)
        fail("cannot write " + std::string(path));
}

template <class Number>
void parse_three(const char* at, const char* end, std::vector<Number>& out)
{
    for (int k = 0; k < 3; ++k)
    {
        while (at < end && *at == ' ')
            ++at;
        Number number{};
        const std::from_chars_result result = std::from_chars(at, end, number);
        if (result.ec != std::errc())
            fail("expected three numbers");
        out.push_back(number);
        at = result.ptr;
    }
}

Mesh parse_obj(const std::string& bytes)
{
    Mesh mesh;
    const char* at = bytes.data();
    const char* const end = at + bytes.size();
    while (at < end)
    {
        const void* const found =
            std::memchr(at, '\n', static_cast<std::size_t>(end - at));
        const char* const line_end = found ? static_cast<const char*>(found) : end;
        if (line_end - at > 2 && at[0] == 'v' && at[1] == ' ')
            parse_three(at + 2, line_end, mesh.places);
        else if (line_end - at > 2 && at[0] == 'f' && at[1] == ' ')
            parse_three(at + 2, line_end, mesh.corners);
        at = line_end + 1;
    }
    for (std::int32_t& corner : mesh.corners)
        --corner;
    return mesh;
}

template <class Number>
void put_line(char kind, const Number* numbers, Number more, std::string& out)
{
    char line[128];
    char* at = line;
    *at++ = kind;
    for (int k = 0; k < 3; ++k)
    {
        *at++ = ' ';
        at = std::to_chars(at, line + sizeof line, numbers[k] + more).ptr;
    }
    *at++ = '\n';
    out.append(line, at);
}

std::string obj_of(const Mesh& mesh)
{
    std::string out;
    for (std::size_t i = 0; i < mesh.places.size(); i += 3)
        put_line('v', &mesh.places[i], 0.0, out);
    for (std::size_t i = 0; i < mesh.corners.size(); i += 3)
        put_line('f', &mesh.corners[i], 1, out);
    return out;
}

/// The header of a binary PLY.
struct Header
{
    std::size_t size = 0, num_vertices = 0, num_faces = 0;
    bool is_double = false;
};

Header header_of(const std::string& bytes)
{
    const std::size_t end = bytes.find("end_header\n");
    if (end == std::string::npos ||
        bytes.find("format binary_little_endian") == std::string::npos)
        fail("need a binary PLY");
    const auto count_of = [&](const char* element)
    {
        const std::size_t at = bytes.find(element);
        return at < end ? std::strtoull(&bytes[at + std::strlen(element)], nullptr, 10)
                        : 0;
    };
    return {end + std::strlen("end_header\n"), count_of("element vertex "),
            count_of("element face "), bytes.find("double x") < end};
}

template <class Stored>
Mesh parse_ply(const std::string& bytes, const Header& header)
{
    Mesh mesh;
    const char* at = bytes.data() + header.size;
    for (std::size_t i = 0; i < 3 * header.num_vertices; ++i, at += sizeof(Stored))
    {
        Stored number;
        std::memcpy(&number, at, sizeof number);
        mesh.places.push_back(static_cast<double>(number));
    }
    for (std::size_t f = 0; f < header.num_faces; ++f)
    {
        if (*at++ != 3)
            fail("need triangles");
        for (int k = 0; k < 3; ++k, at += sizeof(std::int32_t))
        {
            std::int32_t corner;
            std::memcpy(&corner, at, sizeof corner);
            mesh.corners.push_back(corner);
        }
    }
    return mesh;
}

template <class Stored>
std::string ply_of(const Mesh& mesh, const std::string& header)
{
    std::string out = header;
    for (const double place : mesh.places)
    {
        const auto number = static_cast<Stored>(place);
        char raw[sizeof number];
        std::memcpy(raw, &number, sizeof number);
        out.append(raw, sizeof raw);
    }
    for (std::size_t i = 0; i < mesh.corners.size(); i += 3)
    {
        char raw[3 * sizeof(std::int32_t)];
        std::memcpy(raw, &mesh.corners[i], sizeof raw);
        out.push_back(3);
        out.append(raw, sizeof raw);
    }
    return out;
}

double seconds()
{
    return std::chrono::duration<double>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

} // namespace

int main(int argc, char** argv)
{
    if (argc != 3)
        fail("usage: plain_loop IN OUT");
    const std::string path = argv[1];
    const bool is_ply = path.ends_with(".ply");
    const double start = seconds();
    const std::string bytes = read_all(argv[1]);
    const Header header = is_ply ? header_of(bytes) : Header();
    const Mesh mesh = !is_ply            ? parse_obj(bytes)
                      : header.is_double ? parse_ply<double>(bytes, header)
                                         : parse_ply<float>(bytes, header);
    const double read = seconds();
    const std::string head = bytes.substr(0, header.size);
    write_all(argv[2], !is_ply            ? obj_of(mesh)
                       : header.is_double ? ply_of<double>(mesh, head)
                                          : ply_of<float>(mesh, head));
    const double end = seconds();
    std::printf("{\"vertices\": %zu, \"load\": %.4f, \"write\": %.4f, \"total\": %.4f}\n",
                mesh.places.size() / 3, read - start, end - read, end - start);
}
