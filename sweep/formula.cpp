#include <sweep/formula.h>

#include <base/error.h>

#include <muParser.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace palpate::sweep {

double evaluate(const std::string& formula, const std::map<std::string, double>& values)
{
    try {
        mu::Parser parser, names;  // the second says which of them it uses; a formula may assign to its variables
        std::map<std::string, double> variables = values;
        for (auto& [name, value] : variables) {
            parser.DefineConst(name, value);
            names.DefineVar(name, &value);
        }
        parser.SetExpr(formula);
        names.SetExpr(formula);
        const double value = parser.Eval();
        // Several values between commas give the last one: 0,5 would be 5.
        base::failIf(parser.GetNumResults() > 1, "formula '{}': has several values: write a decimal point", formula);
        // A comparison with what is missing would be 0, a number like any other.
        const auto isMissing = [](const auto& used) { return std::isnan(*used.second); };
        return std::ranges::any_of(names.GetUsedVar(), isMissing) ? std::numeric_limits<double>::quiet_NaN() : value;
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
