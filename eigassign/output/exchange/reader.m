function [hz, K, M, status] = @NAME@(q, y)
% Frequencies of a reduced model of eigassign, from @FILE@ beside this file.
%
%   hz = @NAME@(q, y)           in Hz, one for each of its modes
%   [hz, K, M] = @NAME@(q, y)   and K, M of K phi = (2 pi f)^2 M phi
%   [hz, ~, ~, status] = @NAME@(q, y)   0, or why hz is NaN: 1 q or y is not where the model was
%       made for, 2 a closed loop cannot be closed there, 3 K is not positive definite
%
% @ABOUT@
% q in rad or m and y in SI units, as vectors. It does not estimate its error.
    persistent model
    if isempty(model)
        model = load(fullfile(fileparts(mfilename('fullpath')), '@FILE@'));
    end
    x = [q(:); y(:)];
    if numel(x) ~= model.n_q + model.n_y
        error('eigassign:length', 'q or y has another length than that of the model');
    end
    [hz, K, M, status] = deal(nan(numel(model.modes), 1), [], [], 0);
    if ~all(x >= model.lower(:) & x <= model.upper(:))
        status = 1;
        return
    end
    try
        [hz, K, M] = solved(model, x);
    catch problem
        names = {'eigassign:domain', 'eigassign:loop', 'eigassign:indefinite'};
        status = find(strcmp(problem.identifier, names));
        if isempty(status)
            rethrow(problem)
        end
    end
end

function [hz, K, M] = solved(model, x)
    z = reshape(model.shift, [], 1);
    if ~isempty(x) && ~isempty(z)
        z = z + model.to_program * x;
    end
    theta = [1; run(model, 1, z)];
    if ~all(isfinite(theta))
        error('eigassign:domain', 'q or y is outside the domain of a section or length');
    end
    k = double(model.size);
    K = summed(model.stiffness_terms, model.stiffness, theta, k);
    M = summed(model.mass_terms, model.mass, theta, k + double(model.rigid));
    e = 1:k;
    f = k+1:size(M, 1);
    M = M(e, e) - M(e, f) * (M(f, f) \ M(f, e));
    [L, fails] = chol((K + K') / 2, 'lower');
    if fails
        error('eigassign:indefinite', 'the stiffness matrix is not positive definite');
    end
    A = L \ (L \ M)';
    mu = sort(eig((A + A') / 2), 'descend');
    hz = 1 ./ (2 * pi * sqrt(mu(double(model.modes(:)))));
end

function A = summed(terms, triangles, theta, n)
    A = zeros(n);
    values = reshape(theta(double(terms(:)) + 1), 1, []) * triangles;
    A(triu(true(n))) = values; % its columns are the rows of the lower triangle
    A = A + triu(A, 1)';
end

function out = run(model, f, arguments)
    about = double(model.functions(f, :));
    v = zeros(about(4), 1);
    v(1:numel(arguments)) = arguments;
    n = numel(arguments);
    for k = about(1)+1:about(2)
        part = double(model.first_atom(k))+1:double(model.first_atom(k + 1));
        a = v(double(model.atoms(part)) + 1);
        number = model.numbers(k);
        switch double(model.kinds(k))
            case 0
                new = number + sum(reshape(model.weights(part), [], 1) .* a(:));
            case 1
                new = a(1) * a(2);
            case 2
                new = a(1) ^ number;
            case 3
                new = sin(a(1));
            case 4
                new = cos(a(1));
            case 5
                new = exp(a(1));
            case 6
                A = reshape(a(1:number^2), number, number)';
                B = reshape(a(number^2+1:end), [], number)';
                new = reshape((A \ B)', [], 1);
            otherwise
                new = closed(model, number + 1, a(:));
        end
        if ~isreal(new)
            error('eigassign:domain', 'q or y is outside the domain of a section or length');
        end
        v(n+1:n+numel(new)) = new;
        n = n + numel(new);
    end
    part = double(model.first_output(f))+1:double(model.first_output(f + 1));
    out = reshape(v(double(model.outputs(part)) + 1), [], 1);
end

function p = closed(model, f, a)
    size_p = double(model.functions(f, 5));
    known = model.known(double(model.first_known(f))+1:double(model.first_known(f + 1)));
    known = known(:);
    a0 = known(1:end-size_p);
    p0 = known(end-size_p+1:end);
    far = max([0; abs(a - a0)]);
    if ~(far < 500)
        error('eigassign:loop', 'a closed loop cannot be followed so far');
    end
    for refinement = [1 4 16 64]
        [p, ok] = followed(model, f, a0, p0, a, refinement * max(ceil(far / 0.15), 1));
        if ok
            return
        end
    end
    error('eigassign:loop', 'a closed loop cannot be closed, or is at a dead point');
end

function [p, ok] = followed(model, f, a0, p, a, steps)
    ok = false;
    [~, ~, J] = equations(model, f, a0, p);
    smallest = min(svd(J));
    for k = 1:steps
        before = J;
        here = a0 + k / steps * (a - a0);
        tolerance = 1e-6;
        if k == steps
            tolerance = 1e-13;
        end
        for turn = 1:12
            [F, ~, J] = equations(model, f, here, p);
            if ~all(isfinite(J(:)))
                return
            end
            step = -(J \ F);
            p = p + max(min(step, 0.5), -0.5);
            if max(abs(step)) < tolerance
                break
            end
        end
        s = svd(J);
        regular = max(abs(step)) < max(tolerance, 1e-8) && min(s) > 1e-5 * max(s);
        if ~(regular && norm(J - before, 'fro') < smallest)
            return
        end
        smallest = min(s);
    end
    [F, check] = equations(model, f, a, p);
    ok = max(abs([F; check])) < 1e-9;
end

function [F, check, J] = equations(model, f, a, p)
    about = double(model.functions(f, 5:7));
    rows = run(model, f, [a; p]);
    F = rows(1:about(2));
    check = rows(about(2)+1:about(2)+about(3));
    J = reshape(rows(about(2)+about(3)+1:end), about(1), about(2))';
end
