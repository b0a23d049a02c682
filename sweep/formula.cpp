#include <sweep/formula.h>

#include <muParser.h>

#include <stdexcept>

namespace palpate::sweep {

double evaluate(const std::string& formula, const std::map<std::string, double>& values)
{
    try {
        mu::Parser parser;
        for (const auto& [name, value] : values) {
            parser.DefineConst(name, value);
        }
        parser.SetExpr(formula);
        return parser.Eval();
    } catch (const mu::Parser::exception_type& e) {
        throw std::runtime_error("formula '" + formula + "': " + e.GetMsg());
    }
}

bool isVariable(const std::string& name)
{
    return !name.empty() &&
           name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") == std::string::npos &&
           (name[0] < '0' || name[0] > '9');
}

}  // namespace palpate::sweep
