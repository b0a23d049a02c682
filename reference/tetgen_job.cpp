#include <reference/tetgen_job.h>

#include <base/error.h>

#include <fstream>
#include <type_traits>

namespace palpate::reference {

namespace {

class Writer {
public:
    explicit Writer(const std::filesystem::path& file) : file_(file), out_(file, std::ios::binary) {}

    // All parts of the file, which is whole then.
    void finish(const auto&... parts)
    {
        (put(parts), ...);
        out_.close();
        base::failIf(!out_, "{}: cannot be written: is the disk full?", file_.native());
    }

private:
    template <typename T>
    void put(const T& value)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        out_.write(reinterpret_cast<const char*>(&value), sizeof value);
    }
    template <typename T>
    void put(const std::vector<T>& values)
    {
        put(values.size());
        out_.write(reinterpret_cast<const char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(T)));
    }
    void put(const std::string& text) { put(std::vector<char>(text.begin(), text.end())); }
    std::filesystem::path file_;
    std::ofstream out_;
};

class Reader {
public:
    explicit Reader(const std::filesystem::path& file)
        : file_(file), in_(file, std::ios::binary), bytes_(in_ ? std::filesystem::file_size(file) : 0)
    {
        check();
    }

    void take(auto&... parts) { (takeOne(parts), ...); }

private:
    template <typename T>
    void takeOne(T& value)
    {
        static_assert(std::is_trivially_copyable_v<T>);
        in_.read(reinterpret_cast<char*>(&value), sizeof value);
        check();
    }
    template <typename T>
    void takeOne(std::vector<T>& values)
    {
        std::size_t count = 0;
        takeOne(count);
        if (count > bytes_ / sizeof(T)) {
            in_.setstate(std::ios::failbit);
            check();
        }
        values.resize(count);
        in_.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(count * sizeof(T)));
        check();
    }

    void takeOne(std::string& text)
    {
        std::vector<char> bytes;
        takeOne(bytes);
        text.assign(bytes.begin(), bytes.end());
    }

    void check() const { base::failIf(!in_, "{}: is no whole job of TetGen's", file_.native()); }

    std::filesystem::path file_;
    std::ifstream in_;
    std::uintmax_t bytes_;
};

}  // namespace

void write(const std::filesystem::path& file, const TetGenJob& job)
{
    Writer(file).finish(job.switches, job.points, job.facets, job.regions);
}

void write(const std::filesystem::path& file, const TetGenResult& result)
{
    Writer(file).finish(result.error, result.points, result.tets, result.region, result.faces);
}

TetGenJob readJob(const std::filesystem::path& file)
{
    TetGenJob job;
    Reader(file).take(job.switches, job.points, job.facets, job.regions);
    return job;
}

TetGenResult readResult(const std::filesystem::path& file)
{
    TetGenResult result;
    Reader(file).take(result.error, result.points, result.tets, result.region, result.faces);
    return result;
}

}  // namespace palpate::reference
